# SPDX-License-Identifier: Apache-2.0
"""Bakes beside the reference, which knows of a bake what the bake knew."""

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt

from usd.baking.bake import bake
from usd.baking.simulate import simulate
from usd.review import subject
from usd.review.evaluate import evaluate

from ..shots import Recipe, strand_points, write_loop, write_shot


def test_a_part_of_a_shot_is_compared_with_hair_that_knows_what_came_before(tmp_path, model):
    """The network reads the motion before the first frame baked; a reference at rest there would be another shot's."""
    pytest.importorskip("warp", reason="the extra 'train' is not installed")
    shot, tips = write_shot(tmp_path, Recipe(frames=24, strands=8)), []
    for frames in ("1:24", "13:24"):
        bake(shot, tmp_path / "hair.usdc", model, frames=frames, velocities=False)
        tips.append(evaluate(tmp_path / "hair.usdc", reference=True).curves["/Hero/Hair"]["reference"])
    assert np.linalg.norm(tips[1][0]) > 0.005
    np.testing.assert_allclose(tips[1], tips[0][12:], atol=1e-5)


def test_a_loop_is_compared_with_a_loop(tmp_path, model):
    """Otherwise the reference begins at rest where the bake remembers the end, and takes the loop's seam as a stop."""
    pytest.importorskip("warp", reason="the extra 'train' is not installed")
    shot, off = write_loop(tmp_path), {}
    for loop in (False, True):
        bake(shot, tmp_path / "hair.usdc", model, loop=loop, velocities=False)
        tips = evaluate(tmp_path / "hair.usdc", reference=True).curves["/Hero/Hair"]["reference"]
        off[loop] = np.linalg.norm(tips[0] - tips[-1])
    assert off[True] < 5e-4 < 5e-3 < off[False]


def test_a_simulation_is_compared_with_the_solver_as_it_was(tmp_path, monkeypatch):
    """The solver keeps strands apart if the bake records that."""
    pytest.importorskip("warp", reason="the extra 'train' is not installed")
    shot = write_shot(tmp_path, Recipe(frames=12, vertices=24))
    for volume in (0.0, 3.0):
        simulate(shot, tmp_path / "hair.usdc", volume=volume)
        card = evaluate(tmp_path / "hair.usdc", reference=True)
        rows = card.compared["/Hero/Hair"]
        assert rows["bake"]["motion_error_median"] < 0.004 and rows["bake"]["position_percent"] < 0.1, volume
        assert not any("crowd less" in note for note in card.notes)
    monkeypatch.setattr(subject, "REFERENCE_STRANDS", 20)
    assert sum("crowd less" in note for note in evaluate(tmp_path / "hair.usdc", reference=True).notes) == 1


def coiled(path, strands=12, vertices=150):
    """Make a shot's groom coils: ten turns of 8 mm radius on straight lines of 20 cm."""
    stage = Usd.Stage.Open(str(path))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    share = np.linspace(0, 1, vertices)
    angle, radius = 20 * np.pi * share, 0.008 * np.minimum(1, 6 * share)
    turns = np.stack([radius * np.cos(angle), -0.2 * share, radius * np.sin(angle)], axis=1)
    points = strand_points(strands, 2)[:, :1] + turns
    curves.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(points.reshape(-1, 3).astype(np.float32)))
    curves.GetCurveVertexCountsAttr().Set([vertices] * strands)
    stage.Save()
    return path


def test_of_coils_the_motion_of_their_lines_is_measured(tmp_path):
    """The solver moves the lines: its own bake is neither wrong nor crinkled."""
    pytest.importorskip("warp", reason="the extra 'train' is not installed")
    shot = coiled(write_shot(tmp_path, Recipe(frames=24, strands=12)))
    simulate(shot, tmp_path / "hair.usdc")
    card = evaluate(tmp_path / "hair.usdc", reference=True)
    values, bake_row = card.grooms["/Hero/Hair"], card.compared["/Hero/Hair"]["bake"]
    assert values["turn_degrees"] == pytest.approx(values["turn_at_rest_degrees"], rel=0.2)
    assert values["energy_bend"] < 0.02
    assert bake_row["motion_error_median"] < 0.03 and bake_row["position_percent"] < 0.3
