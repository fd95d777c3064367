# SPDX-License-Identifier: Apache-2.0
"""Bring a VRM or glTF avatar to USD with Blender's own importer and exporter.

    python examples/vrm_to_usd.py avatar.vrm -o avatar.usdc     (in a Python that has bpy: pip install bpy)

prints the `--chains` patterns that the VRM's spring-bone groups name, for `neuralocks rig train avatar.usdc`. Rest transforms
of Blender's files are the pose at the first frame; bind transforms are right, and those are what is read.
"""

import argparse
import json
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
    bpy.ops.wm.usd_export(filepath=str(options.out), export_armatures=True, only_deform_bones=False)
    print(" ".join(f"--chains {name}" for name in spring_bone_names(options.avatar)))


def spring_bone_names(path: Path) -> list[str]:
    """Names of the joints that a VRM 0.x file's spring-bone groups below the head start from; none for plain glTF."""
    with open(path, "rb") as file:
        magic, _, _, length, kind = struct.unpack("<4sIII4s", file.read(20))
        if magic != b"glTF" or kind != b"JSON" or length > path.stat().st_size:
            return []
        scene = json.loads(file.read(length))
    vrm = scene.get("extensions", {}).get("VRM", {})
    nodes = scene.get("nodes", [])
    head = {bone["node"] for bone in vrm.get("humanoid", {}).get("humanBones", ()) if bone["bone"] == "head"}
    below = {child for node in head for child in nodes[node].get("children", ())}
    springs = {bone for group in vrm.get("secondaryAnimation", {}).get("boneGroups", ()) for bone in group["bones"]}
    return [nodes[i]["name"] for i in sorted(springs & below)]


if __name__ == "__main__":
    from blender_exit import run_and_leave

    run_and_leave(main)
