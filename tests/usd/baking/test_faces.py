# SPDX-License-Identifier: Apache-2.0
"""Hair on a face whose blend shapes move its skin, or on a body of another shape than it was groomed on."""

import numpy as np
import pytest
from pxr import Usd, UsdSkel, Vt

from tests.strand_models import write_random_model
from usd.baking.bake import bake
from usd.baking.simulate import simulate
from usd.review.evaluate import evaluate
from usd.review.inspect import inspect

from ..shots import CENTRE, Recipe, samples, strand_points, world_points, write_shot

LAST, AROUND = 9, 0.2


def face(folder, weights, way=None, unit=0.01):
    """A shot in centimetres, Z up, whose head's skin a blend shape moves by `way` [m], or makes half as large again."""
    path = write_shot(folder, Recipe(bound="mesh", unit=unit, up="Z", strands=12))
    stage = Usd.Stage.Open(str(path))
    mesh = stage.GetPrimAtPath("/Hero/Skin")
    points = np.array(mesh.GetAttribute("points").Get(), float) * unit
    centre = CENTRE[[0, 2, 1]] * [1, -1, 1]
    off = points - centre
    offsets = np.where((np.linalg.norm(off, axis=1) < AROUND)[:, None], off * 0.5 if way is None else way, 0) / unit
    shape = UsdSkel.BlendShape.Define(stage, "/Hero/Skin/Moved")
    shape.CreateOffsetsAttr(Vt.Vec3fArray.FromNumpy(offsets.astype(np.float32)))
    binding = UsdSkel.BindingAPI.Apply(mesh)
    binding.CreateBlendShapesAttr(["moved"])
    binding.CreateBlendShapeTargetsRel().SetTargets([shape.GetPath()])
    animation = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion"))
    animation.CreateBlendShapesAttr(["moved"])
    for code, weight in weights.items():
        animation.CreateBlendShapeWeightsAttr().Set([weight], code)
    stage.Save()
    return path


@pytest.mark.parametrize("resolve", [False, True])
def test_hair_rides_on_a_face_that_moves(tmp_path, still_model, resolve):
    """It moves as much as its skin, in the head's axes, and in part between keys; nothing moves where no shape does."""
    way = np.array([0.002, -0.012, 0.005])
    moving = bake(face(tmp_path, {1: 0.0, LAST: 1.0}, way), tmp_path / "moving.usdc", still_model, resolve=resolve)
    (tmp_path / "still").mkdir()
    still = bake(face(tmp_path / "still", {1: 0.0}, way), tmp_path / "still.usdc", still_model, resolve=resolve)
    assert not any("skin" in note for note in moving.notes)
    rest = strand_points(12, 12).reshape(-1, 3)
    for code in (1, 5, LAST):
        with_it, without = (world_points(out.path, code) for out in (moving, still))
        axes, _, _, _ = np.linalg.lstsq(rest - rest[0], without - without[0], rcond=None)
        expected = (code - 1) / (LAST - 1) * (way[[0, 2, 1]] * [1, 1, -1]) @ axes
        near = 5e-4 if resolve else 2e-6  # moving skin is measured more roughly than still skin
        np.testing.assert_allclose(with_it - without, np.broadcast_to(expected, rest.shape), atol=near)
    np.testing.assert_array_equal(samples(moving.path, "points", at=1), samples(still.path, "points", at=1))


def test_a_face_alone_may_be_animated(tmp_path, still_model):
    """UsdSkel applies the blend shapes of an animation that has no joints at all."""
    way = np.array([0.002, -0.012, 0.005])
    shot = face(tmp_path, {1: 0.0, LAST: 1.0}, way)
    stage = Usd.Stage.Open(str(shot))
    for name in ("joints", "translations", "rotations", "scales"):
        stage.GetPrimAtPath("/Hero/Rig/Motion").RemoveProperty(name)
    stage.Save()
    out = bake(shot, tmp_path / "out.usdc", still_model, resolve=False)
    assert not any("ignores" in note for note in out.notes)
    moved = world_points(out.path, LAST) - world_points(out.path, 1)
    np.testing.assert_allclose(moved, np.broadcast_to(way[[0, 2, 1]] * [1, 1, -1], moved.shape), atol=2e-6)
    assert inspect(shot)["stops"] == []


def test_hair_rides_on_skin_between_samples_as_usd_skel_moves_it(tmp_path, still_model):
    """Past an inbetween, and up to a step between two samples close to each other."""
    weights = {1: 0.0, 3: 1.0, 4.999: 1.0, 5: 0.0, LAST: 0.0}
    way = np.array([0.01, 0.0, 0.0])
    shot = face(tmp_path, weights, way)
    stage = Usd.Stage.Open(str(shot))
    shape = UsdSkel.BlendShape(stage.GetPrimAtPath("/Hero/Skin/Moved"))
    middle = shape.CreateInbetween("middle")
    middle.SetWeight(0.7)
    middle.SetOffsets(Vt.Vec3fArray.FromNumpy(-np.array(shape.GetOffsetsAttr().Get())))
    stage.Save()
    codes = [1, 2.25, 2.4, 2.7, 4.6, 5]
    moving = bake(shot, tmp_path / "moving.usdc", still_model, frames=codes, resolve=False).path
    (tmp_path / "still").mkdir()
    still = face(tmp_path / "still", {1: 0.0}, way)
    still = bake(still, tmp_path / "still.usdc", still_model, frames=codes, resolve=False).path
    for code in codes:
        weight = np.interp(code, list(weights), list(weights.values()))
        expected = 0.01 * np.interp(weight, [0, 0.7, 1], [0, -1, 1])
        moved = world_points(moving, code) - world_points(still, code)
        np.testing.assert_allclose(np.linalg.norm(moved, axis=1), abs(expected), atol=1e-5)


def test_hair_lies_on_a_head_larger_than_it_was_groomed_on(tmp_path, still_model):
    out = bake(face(tmp_path, {1: 1.0}), tmp_path / "out.usdc", still_model, resolve=False).path
    roots = world_points(out, 1).reshape(12, 12, 3)[:, 0]
    was = strand_points(12, 12)[:, 0] - CENTRE
    np.testing.assert_allclose(roots - CENTRE, 1.5 * was, atol=2e-3)  # on a ball with flat faces
    card = evaluate(out).grooms["/Hero/Hair"]
    assert card["penetration_percent"] < 1 and card["speed_cm_s"] == pytest.approx(0, abs=0.01)


def test_hair_is_pushed_out_of_a_head_larger_than_it_was_groomed_on(tmp_path):
    """Starting from its place on that head: by its own points it would rest deep inside, and be left there."""
    shot, lively, depths = face(tmp_path, {1: 1.0}), write_random_model(tmp_path / "lively.neuralocks", 25), []
    for resolve in (False, True):
        out = bake(shot, tmp_path / f"{resolve}.usdc", lively, resolve=resolve).path
        depths.append(evaluate(out).grooms["/Hero/Hair"]["penetration_worst_mm"])
    assert depths[0] > 10 and depths[1] < 0.4 * depths[0]


def test_the_solver_and_the_report_card_see_the_same_skin(tmp_path):
    """A face that goes down and up again carries the solver's hair along, which does not count as motion of the hair."""
    pytest.importorskip("warp")
    way, cards = np.array([0.0, 0.0, -0.02]), []
    for name, weights in (("moving", {1: 0.0, 5: 1.0, LAST: 0.0}), ("still", {1: 0.0})):
        (tmp_path / name).mkdir()
        out = simulate(face(tmp_path / name, weights, way), tmp_path / f"{name}.usdc", strands=12).path
        cards.append(evaluate(out, reference=True))
    for code in (1, 5, LAST):
        with_it, without = (world_points(tmp_path / f"{name}.usdc", code) for name in ("moving", "still"))
        roots = np.linalg.norm(with_it - without, axis=1).reshape(12, 12)[:, 0]
        np.testing.assert_allclose(roots, 0.02 * (code == 5), atol=1e-5)
    moving, still = (card.grooms["/Hero/Hair"] for card in cards)
    assert moving["speed_cm_s"] == pytest.approx(still["speed_cm_s"], rel=0.05)
    assert cards[0].compared["/Hero/Hair"]["bake"]["position_percent"] < 0.1
