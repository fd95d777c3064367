# SPDX-License-Identifier: Apache-2.0
"""Which hair `evaluate_rig` reads, what it says meanwhile, and a character that only its parent moves."""

import pytest
from pxr import Usd, UsdGeom, UsdSkel

from neuralocks_core.errors import NeuralocksError
from usd.rig.evaluate import evaluate_rig
from usd.rig.stage import read_rigged_hair

from ..rig_shots import small_shot


def test_who_is_measured_is_who_is_named(tmp_path, monkeypatch):
    asked = {"skeleton": "/Who/Rig", "head": "kopf", "chains": ["hair_0"], "joints": {"neck": "hals"}}

    def read(path, **named):
        assert (path, named) == (tmp_path, asked | {"baked_first": True})
        raise NeuralocksError("read")

    monkeypatch.setattr("usd.rig.evaluate.read_rigged_hair", read)
    with pytest.raises(NeuralocksError, match="^read$"):
        evaluate_rig(tmp_path, **asked)


@pytest.mark.parametrize("last", [2, 3])
def test_of_what_only_a_parent_moves_hair_is_carried_rigidly(tmp_path, last):
    """No animation of joints is needed; every sample is told as it is posed."""
    shot, said = small_shot(tmp_path / "shot.usda"), []
    stage = Usd.Stage.Open(str(shot))
    UsdSkel.BindingAPI(stage.GetPrimAtPath("/Who/Rig")).GetAnimationSourceRel().SetTargets([])
    for path in ("/Who", "/Who/Rig"):
        UsdSkel.BindingAPI.Apply(stage.GetPrimAtPath(path)).CreateAnimationSourceRel().SetTargets([])
    turn = UsdGeom.Xformable(stage.GetPrimAtPath("/Who")).AddRotateYOp()
    for code in range(1, last + 1):
        turn.Set(10.0 * code, code)
    stage.SetEndTimeCode(last)
    stage.GetRootLayer().Save()
    assert read_rigged_hair(shot).stage_rig.joints.animation is None
    card = evaluate_rig(shot, progress=lambda *words: said.append(words)).measures
    assert card["frames"] == last and card["swing_mm"] == pytest.approx(0, abs=1e-6)
    assert said == [(done + 1, last, "posing the hair") for done in range(last)]
