# SPDX-License-Identifier: Apache-2.0
"""Bring a VRM or glTF avatar to USD with Blender's own importer and exporter.

    python examples/vrm_to_usd.py avatar.vrm -o avatar.usdc     (in a Python that has bpy: pip install bpy)

prints the `--chains` patterns that the VRM's spring-bone groups name, for `neuralocks rig train avatar.usdc`. Rest transforms
of Blender's files are the pose at the first frame; bind transforms are right, and those are what is read.
"""

import argparse
import json
import re
import shutil
import struct
import tempfile
from pathlib import Path


def main() -> None:
    """Convert one file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("avatar", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    options = parser.parse_args()
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "avatar.glb"  # the importer goes by the extension
        shutil.copyfile(options.avatar, copy)
        bpy.ops.import_scene.gltf(filepath=str(copy))
    for shape in [o for o in bpy.data.objects if o.type == "MESH" and not o.modifiers]:
        bpy.data.objects.remove(shape)  # the importer's own drawing of bones
    bpy.ops.wm.usd_export(filepath=str(options.out), export_armatures=True, only_deform_bones=False, allow_unicode=True)
    print(" ".join(f"--chains {name}" for name in spring_bone_names(options.avatar)))


def spring_bone_names(path: Path) -> list[str]:
    """Names, as Blender writes them to USD, of the joints that a VRM 0.x or 1.0 file's spring bones below the head start
    from; none for plain glTF.
    """
    with open(path, "rb") as file:
        magic, _, _, length, kind = struct.unpack("<4sIII4s", file.read(20))
        if magic != b"glTF" or kind != b"JSON" or length > path.stat().st_size:
            return []
        scene = json.loads(file.read(length))
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
    return [re.sub(r"\W", "_", nodes[node]["name"]) for node in sorted(starts)]


if __name__ == "__main__":
    from blender_exit import run_and_leave

    run_and_leave(main)
