# SPDX-License-Identifier: Apache-2.0
"""An avatar in USD: what its own spring bones say is hair, in both versions of VRM, and all that it came with."""

import runpy
import subprocess
from pathlib import Path

import pytest
from pxr import Usd, UsdGeom, UsdSkel

from usd.rig.stage import read_rigged_hair

from ..blenders import installed
from .avatars import avatar

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


def names(extensions, nodes=NODES) -> list[str]:
    """What the script prints for a file with these extensions."""
    script, scene = runpy.run_path(str(SCRIPT)), {"nodes": [dict(node) for node in nodes], "extensions": extensions}
    script["name_apart"](scene)
    return script["spring_bone_names"](scene)


def test_chains_are_named_by_both_versions():
    """Only those below the head, by the first joint of each, with or without a holder, in letters that USD allows."""
    old = {
        "humanoid": {"humanBones": [{"bone": "head", "node": 0}]},
        "secondaryAnimation": {"boneGroups": [{"bones": [1, 3]}, {"bones": [4, 6]}]},
    }
    springs = [{"joints": [{"node": 1}, {"node": 3}]}, {"joints": [{"node": 4}]}, {"joints": [{"node": 6}]}]
    new = {
        "VRMC_vrm": {"humanoid": {"humanBones": {"head": {"node": 0}}}},
        "VRMC_springBone": {"springs": springs},
    }
    assert names({"VRM": old}) == names(new) == ["hair_L", "前髪"]
    assert names({}) == []


def test_equal_names_and_none_are_told_apart():
    """In names that USD accepts as they are."""
    nodes = [{"children": [1, 2, 3, 4]}, {"name": "a b"}, {"name": "a b"}, {"name": "a_b"}, {"name": "1"}]
    springs = [{"joints": [{"node": node}]} for node in range(1, 5)]
    head = {"humanoid": {"humanBones": {"head": {"node": 0}}}}
    found = names({"VRMC_vrm": head, "VRMC_springBone": {"springs": springs}}, nodes)
    assert found == ["a_b", "a_b_2", "a_b_3", "_1"]


def test_long_names_are_cut_to_what_blender_takes():
    """At a letter boundary, and made unique after that: a chain is printed by the name that its joint has."""
    stem, kana = "Hair_" + 58 * "a", "前" * 22
    nodes = [{"name": "Head", "children": [1, 2, 3]}, {"name": stem + "_A"}, {"name": stem + "_B"}, {"name": kana}]
    springs = [{"joints": [{"node": node}]} for node in (1, 2, 3)]
    head = {"humanoid": {"humanBones": {"head": {"node": 0}}}}
    found = names({"VRMC_vrm": head, "VRMC_springBone": {"springs": springs}}, nodes)
    assert found == [stem, stem[:-2] + "_2", kana[:21]]


def test_what_is_no_binary_gltf_is_refused(tmp_path):
    (path := tmp_path / "avatar.vrm").write_text("{}")
    with pytest.raises(SystemExit, match="not a binary glTF file"):
        runpy.run_path(str(SCRIPT))["read"](path)


@pytest.mark.parametrize("fps", [30, 24])
def test_an_avatar_comes_with_its_motion_and_what_it_wears(tmp_path, fps):
    """Chains of equal names are found as they are printed; the meshes that Blender draws bones with are left out."""
    blender = next(iter(installed()), None)
    if blender is None:
        pytest.skip("needs Blender as a Python module (make blender)")
    out, vrm = tmp_path / "out.usdc", avatar(tmp_path / "avatar.vrm", seconds=0.5)
    command = [str(blender), str(SCRIPT), str(vrm), "-o", str(out), "--fps", str(fps)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and "animations left out: Nod more" in done.stderr, done.stderr
    stage = Usd.Stage.Open(str(out))
    assert stage.GetTimeCodesPerSecond() == fps and stage.GetEndTimeCode() - stage.GetStartTimeCode() == fps / 2
    assert sorted(prim.GetName() for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)) == ["Glasses", "Skin"]
    named = done.stdout.strip().splitlines()[-1].replace("--chains", "").split()
    hair = read_rigged_hair(out, chains=named)
    assert sorted(hair.rig.chains.tops) == sorted(named) == ["Hair_1", "Hair_1_2"]
    animation = UsdSkel.Animation(hair.stage_rig.joints.animation)
    head = [name.rsplit("/", 1)[-1] for name in animation.GetJointsAttr().Get()].index("Head")
    turns = animation.GetRotationsAttr()
    first, last = (turns.Get(code)[head] for code in (turns.GetTimeSamples()[0], turns.GetTimeSamples()[-1]))
    assert abs((first.GetInverse() * last).GetReal() - 0.9659) < 1e-3, "it turns by 30 degrees"
