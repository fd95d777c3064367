# SPDX-License-Identifier: Apache-2.0
"""Of whom a file is that was written here, and what is invisible in it."""

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from usd.assets.own_layers import character_of, is_own, player_of
from usd.assets.scene_writer import HairArrays, SceneArrays, prim_path, write_scene


@pytest.mark.parametrize("name", ["", "Käthe 前"])
def test_shots_tell_their_character(tmp_path, name):
    hair = [_hair("Shown", True), _hair("Backup", False)]
    one, bones = np.eye(4)[None], (1, 1, 3)
    turns = np.array([[[1.0, 0, 0, 0]]])
    arrays = (np.array([1.0]), ["head"], one, one, np.zeros(bones), turns, np.ones(bones), [], np.zeros((1, 0)), hair)
    path = write_scene(tmp_path / "shot.usdc", SceneArrays(1.0, 24.0, *arrays, name, f"{name}.blend"))
    assert is_own(path) and character_of(path) == name and player_of(path) == f"{name}.blend"
    stage = Usd.Stage.Open(str(path))
    seen = [UsdGeom.Imageable(stage.GetPrimAtPath(prim_path(each.name))).ComputeVisibility() for each in hair]
    assert seen == ["inherited", "invisible"]


def test_other_files_tell_none(tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "mine.usda"))
    stage.DefinePrim("/Mine")
    stage.Save()
    (tmp_path / "torn.usdc").write_bytes(b"PXR-USDC torn")
    for told in (character_of, player_of):
        assert [told(tmp_path / name) for name in ("mine.usda", "torn.usdc", "nowhere.usdc")] == ["", "", ""]


def _hair(name: str, visible: bool) -> HairArrays:
    points = np.array([[0, 0, 0], [0, 0, 1.0]])
    place = np.eye(4)
    return HairArrays(name, points, np.array([2]), np.full(1, 0.01), place, place[None], 0, visible=visible)
