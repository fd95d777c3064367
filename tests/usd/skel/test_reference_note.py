# SPDX-License-Identifier: Apache-2.0
"""A take that begins with a reference pose, as takes from FBX do, is told by all that reads the motion of its hair."""

import numpy as np
import pytest
from pxr import Gf, Usd, UsdSkel

from usd.baking.bake import bake
from usd.review.inspect import inspect
from usd.rig.bake import bake_rig
from usd.rig.stage import read_rigged_hair

from ..rig_shots import hair_turns, model_for, small_shot
from ..shots import MOTION, Recipe, write_shot


def _acted(path, motion, before=1, soft=False):
    """The shot with its head turned by about 40 degrees after some frames as bound, at once or `soft`ly."""
    stage = Usd.Stage.Open(str(path))
    animation = UsdSkel.Animation(stage.GetPrimAtPath(motion))
    names = [name.rsplit("/", 1)[-1].lower() for name in animation.GetJointsAttr().Get()]
    skeleton = UsdSkel.Skeleton(next(prim for prim in stage.Traverse() if prim.IsA(UsdSkel.Skeleton)))
    _, rest, _ = UsdSkel.DecomposeTransforms(skeleton.GetRestTransformsAttr().Get())
    for code in animation.GetRotationsAttr().GetTimeSamples():
        turns, since = list(rest), max(code - before, 0)
        angle = np.radians(40 + 3 * np.sin(since / 4)) * (min(since / 12, 1) ** 2 if soft else since > 0)
        turn = Gf.Quatf(float(np.cos(angle / 2)), float(np.sin(angle / 2)), 0, 0)
        turns[names.index("head")] = turns[names.index("head")] * turn
        animation.GetRotationsAttr().Set(turns, code)
    stage.GetRootLayer().Save()
    return path


def _told(notes):
    return [note for note in notes if "begins with the bind or rest pose" in note]


@pytest.mark.parametrize("before", [1, 3])
def test_hair_on_joints(tmp_path, before):
    shot = _acted(small_shot(tmp_path / "shot.usda"), "/Who/Motion", before)
    model = model_for(read_rigged_hair(shot), dynamic=True)
    (note,) = _told(bake_rig(shot, tmp_path / "out.usda", model).notes)
    first = before + 1
    assert note.startswith("/Who/Rig: its animation begins") and f"at {first}," in note and f"(--cuts {first})" in note
    assert _told(inspect(shot)["spoils"]) == [note]
    named = bake_rig(shot, tmp_path / "named.usda", model, cuts=[first])
    assert not _told(named.notes)
    assert np.abs(hair_turns(tmp_path / "out.usda", [first + 1]) - hair_turns(named.path, [first + 1])).max() > 1e-3
    assert not _told(bake_rig(shot, tmp_path / "still.usda", model_for(read_rigged_hair(shot))).notes)
    assert not _told(bake_rig(shot, tmp_path / "loop.usda", model, loop=True).notes)


def test_strands(tmp_path, model):
    shot = _acted(write_shot(tmp_path, Recipe(frames=24, strands=6)), MOTION)
    (note,) = _told(bake(shot, tmp_path / "out.usdc", model, frames="1:3").notes)
    assert "at 2," in note and _told(inspect(shot)["spoils"]) == [note]
    assert not _told(bake(shot, tmp_path / "out.usdc", model, frames="1:3", cuts=[2]).notes)


def test_a_motion_that_begins_in_the_bind_pose_is_no_reference(tmp_path, model):
    shots = [_acted(write_shot(tmp_path, Recipe(frames=24, strands=6)), MOTION, soft=True)]
    shots.append(_acted(small_shot(tmp_path / "rig.usda"), "/Who/Motion", soft=True))
    assert [_told(inspect(shot)["spoils"]) for shot in shots] == [[], []]
