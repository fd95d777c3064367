# SPDX-License-Identifier: Apache-2.0
"""Placing a groom part by part gives what the whole gives."""

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt

import usd.baking.points.placing as placing
from neuralocks_core.strands.strand_set import strands_on
from usd.shot.stage import read_shot

from ..shots import Recipe, write_shot


@pytest.mark.parametrize("wrap", ["pinned", "nonperiodic"])
def test_parts_give_what_the_whole_gives(tmp_path, monkeypatch, wrap):
    path = write_shot(tmp_path, Recipe(strands=300, vertices=10, bound="mesh", basis="catmullRom"))
    stage = Usd.Stage.Open(str(path))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    curves.GetWrapAttr().Set(wrap)
    if wrap == "nonperiodic":  # the second points on the skin, where such curves begin
        points = np.array(curves.GetPointsAttr().Get()).reshape(300, 10, 3)
        points -= points[:, 1:2] - points[:, :1]
        curves.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(points.reshape(-1, 3)))
    stage.Save()
    item = read_shot(path).grooms[0]
    assert (item.beyond is None) == (wrap == "pinned")
    character = item.attachment.character
    whole = strands_on(character, item.groom)
    # As hair moves: each strand in its own way, more towards the tip.
    along = np.linspace(0, 1, whole.rest.shape[1], dtype=np.float32)[:, None]
    moved = np.random.default_rng(0).normal(0, 0.02, (len(whole.rest), 1, 3)).astype(np.float32) * along
    joints = item.attachment.rig.joints_at(5.0)

    def placed(block, part):
        monkeypatch.setattr(placing, "BLOCK", block)
        monkeypatch.setattr(placing, "PART", part)
        placer = placing.GroomPlacer(item)
        assert np.abs(placer.strands.rest - whole.rest).max() < 1e-6
        assert (placer.strands.lock == whole.lock).mean() > 0.98
        return placer.points(5.0, joints, lambda strands: moved[strands])

    one = placed(512, 16384)
    assert np.array_equal(placed(32, 16384), one)
    assert np.abs(placed(32, 64) - one).max() < 1e-5
    rigid = item.groom.points @ character.carrying(joints)[:3, :3].T + character.carrying(joints)[:3, 3]
    drawn = one if item.beyond is None else one[item.beyond.hair]
    assert 1e-3 < np.abs(drawn - rigid).max() < 0.1
    assert len(one) == item.point_count and np.isfinite(one).all()


def test_a_head_that_moves_by_a_tenth_of_a_millimetre_takes_its_hair_along(tmp_path):
    item = read_shot(write_shot(tmp_path)).grooms[0]
    placer, rest = placing.GroomPlacer(item), np.zeros((item.groom.strand_count, 24, 3), np.float32)
    joints = item.attachment.rig.joints_at(1.0)
    moved = joints.copy()
    moved[:, 1, 3] += 1e-4
    here, there = (placer.points(1.0, pose, lambda strands: rest[strands]) for pose in (joints, moved))
    np.testing.assert_allclose(there - here, [[0, 1e-4, 0]] * len(here), atol=1e-6)


@pytest.mark.parametrize("unit", [1.0, 0.0007])
def test_hair_that_stands_where_it_rests_has_its_own_points(tmp_path, monkeypatch, unit):
    """Up to a thousandth of a millimetre, however many units that is: single precision is not more exact. In every part of a groom."""
    monkeypatch.setattr(placing, "BLOCK", 16)
    monkeypatch.setattr(placing, "PART", 16)
    item = read_shot(write_shot(tmp_path, Recipe(unit=unit))).grooms[0]
    joints = item.attachment.rig.joints_at(1.0)
    assert unit == 1 or np.abs(item.attachment.character.carrying(joints) - np.eye(4)).max() > 1e-9
    rest = np.zeros((item.groom.strand_count, 24, 3), np.float32)
    placed = placing.GroomPlacer(item).points(1.0, joints, lambda strands: rest[strands])
    np.testing.assert_array_equal(placed, np.asarray(UsdGeom.BasisCurves(item.prim).GetPointsAttr().Get()))
