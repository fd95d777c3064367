# SPDX-License-Identifier: Apache-2.0
"""Bring a VRM or glTF avatar to USD with Blender's own importer and exporter, with the first of its animations if it has any.

    python examples/vrm_to_usd.py avatar.vrm -o avatar.usdc     (in a Python that has bpy: pip install bpy)

prints the `--chains` patterns that the VRM's spring-bone groups name, for `neuralocks rig train avatar.usdc`. In Blender's
files, rest transforms are the pose at the first frame; bind transforms are right, and are the ones that we read.
"""

import argparse
import json
import math
import struct
import sys
import tempfile
from pathlib import Path

LONGEST = 63
"""Bytes of a name in Blender."""


def main() -> None:
    """Convert one file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("avatar", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--fps", type=int, default=30, help="frames a second of the animation; 30")
    options = parser.parse_args()
    scene, rest = read(options.avatar)
    name_apart(scene)
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = options.fps  # glTF has seconds, which the importer converts to frames
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "avatar.glb"  # the importer goes by the extension
        copy.write_bytes(packed(scene, rest))
        bpy.ops.import_scene.gltf(filepath=str(copy))
    drawn = {bone.custom_shape for thing in bpy.data.objects if thing.pose for bone in thing.pose.bones} - {None}
    for shape in drawn:
        bpy.data.objects.remove(shape)  # the importer's own drawing of bones
    animated = set_range(bpy, bpy.context.scene)
    if left := [each.get("name", "one without a name") for each in scene.get("animations", ())[1:]]:
        print(f"{options.avatar}: animations left out: {', '.join(left)}", file=sys.stderr)
    bpy.ops.wm.usd_export(
        filepath=str(options.out),
        export_armatures=True,
        only_deform_bones=False,
        allow_unicode=True,
        export_animation=animated,
    )
    print(" ".join(f"--chains {name}" for name in spring_bone_names(scene)))


def set_range(bpy, scene) -> bool:
    """Set the scene's frame range to its animation; False if nothing is animated."""
    moved = [thing.animation_data for thing in (*bpy.data.objects, *bpy.data.shape_keys)]
    ranges = [each.action.frame_range for each in moved if each and each.action]
    if ranges:
        scene.frame_start = math.floor(min(first for first, _ in ranges) + 1e-3)
        scene.frame_end = math.ceil(max(last for _, last in ranges) - 1e-3)
    return bool(ranges)


def read(path: Path) -> tuple[dict, bytes]:
    """A binary glTF file's JSON, and everything after it."""
    data = path.read_bytes()
    magic, _, _, length, kind = struct.unpack_from("<4sIII4s", data.ljust(20))
    if magic != b"glTF" or kind != b"JSON" or 20 + length > len(data):
        sys.exit(f"{path}: is not a binary glTF file (.glb, .vrm); export it as such")
    return json.loads(data[20 : 20 + length]), data[20 + length :]


def packed(scene: dict, rest: bytes) -> bytes:
    """A binary glTF file from the output of `read`."""
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text) + len(rest), len(text), b"JSON") + text + rest


def name_apart(scene: dict) -> None:
    """Give all nodes unique names that USD and Blender keep unchanged: glTF allows equal and long names, and Blender numbers the
    former and cuts the latter itself.
    """
    taken = set()
    for node in scene.get("nodes", ()):
        safe = "".join(letter if f"_{letter}".isidentifier() else "_" for letter in node.get("name") or "node")
        safe = safe if safe.isidentifier() else f"_{safe}"
        name = cut(safe)
        number = 1
        while name in taken:
            number += 1
            name = cut(safe, f"_{number}")
        taken.add(name)
        node["name"] = name


def cut(name: str, ending: str = "") -> str:
    """A name with its ending, in whole letters and at most LONGEST bytes."""
    return name.encode()[: LONGEST - len(ending)].decode(errors="ignore") + ending


def spring_bone_names(scene: dict) -> list[str]:
    """Names of the joints that a VRM 0.x or 1.0 file's spring bones below the head start from; none for plain glTF."""
    nodes, extensions = scene.get("nodes", []), scene.get("extensions", {})
    old, new = extensions.get("VRM", {}), extensions.get("VRMC_vrm", {})
    heads = [bone["node"] for bone in old.get("humanoid", {}).get("humanBones", ()) if bone["bone"] == "head"]
    heads += [bone["node"] for name, bone in new.get("humanoid", {}).get("humanBones", {}).items() if name == "head"]
    springs = {bone for group in old.get("secondaryAnimation", {}).get("boneGroups", ()) for bone in group["bones"]}
    for spring in extensions.get("VRMC_springBone", {}).get("springs", ()):
        springs |= {joint["node"] for joint in spring["joints"][:1]}
    starts, todo = [], [child for head in heads for child in nodes[head].get("children", ())]
    while todo:
        node = todo.pop()
        if node in springs:
            starts.append(node)
        else:
            todo += nodes[node].get("children", ())
    return [nodes[node]["name"] for node in sorted(starts)]


if __name__ == "__main__":
    from blender_exit import run_and_leave

    run_and_leave(main)
