# SPDX-License-Identifier: Apache-2.0
"""What a VRM file's own spring bones say is hair, in both versions of the format."""

import json
import runpy
import struct
from pathlib import Path

SCRIPT = Path(__file__).parents[2] / "examples" / "vrm_to_usd.py"
NODES = [
    {"name": "Head", "children": [1, 2, 5]},
    {"name": "hair.L", "children": [3]},
    {"name": "holder", "children": [4]},
    {"name": "hair.L.001"},
    {"name": "前髪"},
    {"name": "eye"},
    {"name": "skirt"},
]


def names(folder, extensions) -> list[str]:
    """What the script prints for a file with these extensions."""
    text = json.dumps({"nodes": NODES, "extensions": extensions}).encode()
    path = folder / "avatar.vrm"
    path.write_bytes(struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text), len(text), b"JSON") + text)
    return runpy.run_path(str(SCRIPT))["spring_bone_names"](path)


def test_chains_are_named_by_both_versions(tmp_path):
    """Only those below the head, by the first joint of each, with or without a holder, in the letters that USD has."""
    old = {
        "humanoid": {"humanBones": [{"bone": "head", "node": 0}]},
        "secondaryAnimation": {"boneGroups": [{"bones": [1, 3]}, {"bones": [4, 6]}]},
    }
    springs = [{"joints": [{"node": 1}, {"node": 3}]}, {"joints": [{"node": 4}]}, {"joints": [{"node": 6}]}]
    new = {
        "VRMC_vrm": {"humanoid": {"humanBones": {"head": {"node": 0}}}},
        "VRMC_springBone": {"springs": springs},
    }
    assert names(tmp_path, {"VRM": old}) == names(tmp_path, new) == ["hair_L", "前髪"]
    assert names(tmp_path, {}) == []
