# SPDX-License-Identifier: Apache-2.0
"""Characters that face otherwise than their stage, by where their left and right joints lie, are told."""

import re

import numpy as np
import pytest
from pxr import Usd, UsdSkel, Vt

from neuralocks_core.rig import RigModel
from usd.review.inspect import inspect
from usd.rig.notes import rigged_notes
from usd.rig.stage import read_rigged_hair
from usd.rig.train import train_rig

from ..rig_shots import EXAMPLE, model_for


@pytest.fixture
def rebound(tmp_path):
    """Makes a copy of the example's shot with joint names and bind transforms changed by a function."""

    def make(change):
        path = tmp_path / "shot.usdc"
        Usd.Stage.Open(str(EXAMPLE / "shot.usda")).Flatten().Export(str(path))
        stage = Usd.Stage.Open(str(path))
        skeleton = next(UsdSkel.Skeleton(prim) for prim in stage.Traverse() if prim.IsA(UsdSkel.Skeleton))
        names, binds = [str(name) for name in skeleton.GetJointsAttr().Get()], skeleton.GetBindTransformsAttr()
        renamed, moved = change(names, np.array(binds.Get()))
        skeleton.GetJointsAttr().Set(renamed)
        binds.Set(Vt.Matrix4dArray.FromNumpy(moved))
        motion = UsdSkel.Animation(UsdSkel.BindingAPI(skeleton.GetPrim()).GetInheritedAnimationSource())
        own = dict(zip(names, renamed))
        motion.GetJointsAttr().Set([own[str(name)] for name in motion.GetJointsAttr().Get()])
        stage.GetRootLayer().Save()
        return path

    return make


def _swapped(names, binds):
    sides = {"l": "r", "r": "l"}
    parts = [name.split("/") for name in names]
    for part in parts:
        part[:] = [f"{p[:-1]}{sides[p[-1]]}" if p[-2:] in ("_l", "_r") else p for p in part]
    return ["/".join(part) for part in parts], binds


def _askew(names, binds):
    """The left arm bound a hand's breadth ahead."""
    binds[["upperarm_l" in name for name in names], 3, 2] += 10 * np.abs(binds[:, 3, 1]).max() / 170
    return names, binds


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_askew, "by 'upperarm_l' and 'upperarm_r', its bind pose faces 1. degrees off the stage's nearest axis"),
        (_swapped, "it faces away from where its toes point, .*; left and right are swapped"),
        (lambda names, binds: (names, binds), None),
    ],
    ids=["askew", "swapped", "plain"],
)
def test_a_bind_pose_that_faces_otherwise_is_told(rebound, change, words):
    shot = rebound(change)
    for notes in (rigged_notes(read_rigged_hair(shot).stage_rig), inspect(shot)["spoils"]):
        assert sum(bool(re.search(words or "faces", note)) for note in notes) == (words is not None), notes


def test_a_trained_model_knows_which_way_its_rig_faces(rebound, tmp_path, monkeypatch):
    """The header says so; whoever trains is told before."""
    pytest.importorskip("torch")
    shot, told = rebound(_askew), []
    hair = read_rigged_hair(shot)
    monkeypatch.setattr("neuralocks_core.training.rig.static.train_static", lambda *_, **__: model_for(hair))
    train_rig(shot, tmp_path / "m.neuralocks", dynamic=False, tell=told.extend)
    kept = RigModel.load(tmp_path / "m.neuralocks").training["facing"]
    assert kept == pytest.approx(hair.stage_rig.character.facing_angle, abs=1e-3) and abs(kept) > 2
    assert any("off the stage's nearest axis" in note for note in told)
