# SPDX-License-Identifier: Apache-2.0
"""Curves whose outer points steer them only: hair begins and ends where it is drawn."""

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt

from usd.baking.bake import bake
from usd.review.baked import read_baked
from usd.review.inspect import inspect
from usd.shot.stage import read_shot
from usd.shot.strands.curve_ends import beyond_ends, ends, undrawn

from ..shots import Recipe, samples, strand_points, world_points, write_shot

STRANDS, VERTICES = 40, 12


def _curves(stage, points, counts, basis="catmullRom", wrap="nonperiodic"):
    curves = UsdGeom.BasisCurves.Define(stage, "/Hair")
    curves.CreateTypeAttr("cubic")
    curves.CreateBasisAttr(basis)
    curves.CreateWrapAttr(wrap)
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.asarray(points, np.float32)))
    curves.CreateCurveVertexCountsAttr(counts)
    return curves.GetPrim()


def _shot(folder, basis, before, after, name):
    """A shot whose strands have these additional points (S, n, 3) at their ends."""
    recipe = Recipe(strands=STRANDS, vertices=VERTICES, basis=basis, bound="mesh")
    path = write_shot(folder, recipe, name)
    stage = Usd.Stage.Open(str(path))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    points = np.concatenate([before, strand_points(STRANDS, VERTICES), after], axis=1)
    curves.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(points.reshape(-1, 3).astype(np.float32)))
    curves.GetCurveVertexCountsAttr().Set([points.shape[1]] * STRANDS)
    curves.GetWrapAttr().Set("nonperiodic")
    stage.Save()
    return path


def test_only_points_that_no_curve_reaches_lie_beyond_its_ends():
    places = np.arange(14.0)[:, None] + [0, 1, 2]
    counts = [5, 4, 3, 2]
    stage = Usd.Stage.CreateInMemory()
    prim = _curves(stage, places, counts)
    beyond = beyond_ends(prim)
    assert beyond.before.tolist() == [0, 5] and beyond.after.tolist() == [4, 8]
    assert ends(prim).tolist() == [0, 5, 9, 12] and ends(prim, last=True).tolist() == [4, 8, 11, 13]
    assert ends(prim, beyond=beyond).tolist() == [1, 6, 9, 12]
    assert ends(prim, last=True, beyond=beyond).tolist() == [3, 7, 11, 13]
    repeated = places.copy()
    repeated[0], repeated[8] = repeated[1], repeated[7]
    assert np.flatnonzero(~beyond_ends(_curves(stage, repeated, counts, "bspline")).hair).tolist() == [4, 5]
    for other in ({"wrap": "pinned"}, {"wrap": "periodic"}, {"basis": "bezier"}):
        assert beyond_ends(_curves(stage, places, counts, **other)) is None
    assert beyond_ends(_curves(stage, places, [5, 5])) is None  # read_groom says what is wrong with them
    prim = _curves(stage, places, counts)
    prim.GetAttribute("type").Set("linear")
    assert beyond_ends(prim) is None


@pytest.mark.parametrize("basis", ["catmullRom", "bspline"])
def test_hair_moves_as_without_the_points_beyond_its_ends(tmp_path, model, basis):
    hair = strand_points(STRANDS, VERTICES)
    before, after = 2 * hair[:, :1] - hair[:, 1:2], 2 * hair[:, -1:] - hair[:, -2:-1]
    shot = _shot(tmp_path, basis, before, after, "steered")
    plain = bake(write_shot(tmp_path, Recipe(bound="mesh"), "plain"), tmp_path / "plain.usdc", model)
    result = bake(shot, tmp_path / "bake.usdc", model)
    assert result.notes == plain.notes and result.grooms[0]["points"] == STRANDS * (VERTICES + 2)
    baked = read_baked(result.path)
    for code in (1.0, 5.0, 8.0):
        moved = world_points(result.path, code).reshape(STRANDS, -1, 3)
        expected = world_points(plain.path, code).reshape(STRANDS, -1, 3)
        np.testing.assert_allclose(moved[:, 1:-1], expected, atol=1e-6)
        # They continue from the ends as before, so the curve keeps its direction there.
        np.testing.assert_allclose(moved[:, 0], 2 * moved[:, 1] - moved[:, 2], atol=1e-5)
        np.testing.assert_allclose(moved[:, -1], 2 * moved[:, -2] - moved[:, -3], atol=1e-5)
        item = baked.shot.grooms[0]
        np.testing.assert_allclose(baked.world(item, code), expected.reshape(-1, 3), atol=1e-6)
    assert np.abs(moved[:, -1] - after[:, 0]).max() > 1e-3
    assert inspect(shot)["grooms"][0]["points beyond the ends, not drawn"] == 2 * STRANDS


def test_points_beyond_the_ends_keep_their_place_against_them(tmp_path, model, still_model):
    """At any place: in a still pose with the author's exact bits, in another with the distances to the end's edge."""
    hair, random = strand_points(STRANDS, VERTICES), np.random.default_rng(0)
    before, after = (hair[:, [end]] + random.normal(0, 0.01, (STRANDS, 1, 3)) for end in (0, -1))
    shot = _shot(tmp_path, "catmullRom", before, after, "askew")
    still = bake(shot, tmp_path / "still.usdc", still_model)
    assert np.array_equal(samples(still.path, "points", at=1.0), samples(shot, "points"))
    result = bake(shot, tmp_path / "bake.usdc", model)
    assert read_shot(shot).grooms[0].point_count == STRANDS * (VERTICES + 2)

    def steering(points):
        points = points.reshape(STRANDS, -1, 3).astype(float)
        return np.stack([np.linalg.norm(points[:, a] - points[:, b], axis=-1) for a, b in ((0, 1), (-1, -2))])

    def leaning(points):
        points = points.reshape(STRANDS, -1, 3).astype(float)
        ways = [(points[:, a] - points[:, b], points[:, c] - points[:, b]) for a, b, c in ((0, 1, 2), (-1, -2, -3))]
        return np.stack([np.sum(own * edge, axis=-1) / np.linalg.norm(edge, axis=-1) for own, edge in ways])

    rest = samples(shot, "points")
    for code in (4.0, 7.5):
        path = result.path if code % 1 == 0 else bake(shot, tmp_path / "one.usdc", model, frames=[code]).path
        moved = world_points(path, code)
        np.testing.assert_allclose(steering(moved), steering(rest), atol=2e-6)
        np.testing.assert_allclose(leaning(moved), leaning(rest), atol=2e-5)


def test_repeated_ends_are_hair_to_their_last_point(tmp_path, model):
    hair = strand_points(STRANDS, VERTICES)
    shot = _shot(tmp_path, "bspline", hair[:, [0, 0]], hair[:, [-1, -1]], "tripled")
    assert read_shot(shot).grooms[0].beyond is None
    plain = bake(write_shot(tmp_path, Recipe(bound="mesh"), "plain"), tmp_path / "plain.usdc", model)
    moved = world_points(bake(shot, tmp_path / "bake.usdc", model).path, 5.0).reshape(STRANDS, -1, 3)
    np.testing.assert_allclose(moved[:, 2:-2].reshape(-1, 3), world_points(plain.path, 5.0), atol=1e-6)
    assert np.array_equal(moved[:, 0], moved[:, 2]) and np.array_equal(moved[:, -1], moved[:, -3])


@pytest.mark.parametrize("basis", ["catmullRom", "bspline"])
def test_first_points_that_lie_on_the_skin_are_roots(tmp_path, model, basis):
    """Many files leave the curves' wrap at its default, but mean hair from its first point to its last: it moves as if pinned."""
    paths = []
    for wrap in ("pinned", "nonperiodic"):
        path = write_shot(tmp_path, Recipe(strands=STRANDS, vertices=VERTICES, basis=basis, bound="mesh"), wrap)
        stage = Usd.Stage.Open(str(path))
        UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetWrapAttr().Set(wrap)
        stage.Save()
        paths.append(bake(path, tmp_path / f"{wrap}.usdc", model).path)
        told = [note for note in read_shot(path).notes if note.endswith("set their wrap to pinned")]
        assert len(told) == (wrap == "nonperiodic")
        (facts,) = inspect(path)["grooms"]
        assert [facts[name] for name in ("type", "basis", "wrap")] == ["cubic", basis, wrap]
    assert np.array_equal(world_points(paths[0], 5.0), world_points(paths[1], 5.0))


@pytest.mark.parametrize("basis", ["bezier", "bspline", "catmullRom"])
@pytest.mark.parametrize("wrap", ["nonperiodic", "pinned"])
def test_strands_that_usd_counts_no_whole_segments_in_are_told(basis, wrap):
    counts = [2, 3, 4, 5, 6, 7, 8, 9, 10]
    stage = Usd.Stage.CreateInMemory()
    prim = _curves(stage, np.random.default_rng(0).normal(size=(sum(counts), 3)), counts, basis, wrap)
    segments = UsdGeom.BasisCurves(prim).ComputeSegmentCounts(Usd.TimeCode.Default())
    whole = {"bezier": lambda n, s: n == 3 * s + 1}.get(basis, lambda n, s: s > 0)
    odd = sum(not whole(n, s) for n, s in zip(counts, segments))
    if odd:
        (note,) = undrawn(prim)
        assert note.startswith(f"/Hair: {odd} of 9 strands have 2, 3")
    else:
        assert undrawn(prim) == []


@pytest.mark.parametrize(
    ("counts", "wrap", "told"),
    [([1, 7], "nonperiodic", None), ([3, 7], "periodic", None), ([2, 3, 3, 5, 7], "pinned", "4 of 5 strands have 2, 3, 5 points,"),
     ([2, 3, 5, 6], "nonperiodic", "4 of 4 strands have 2, 3, 5, ... points,")],
)  # fmt: skip
def test_which_strands_lack_points_is_told(counts, wrap, told):
    """Not lone points, which have another note, nor closed curves."""
    stage = Usd.Stage.CreateInMemory()
    notes = undrawn(_curves(stage, np.zeros((sum(counts), 3)), counts, "bezier", wrap))
    assert told in notes[0] if told else notes == []


def test_a_bake_tells_of_strands_that_are_not_drawn(tmp_path, model):
    recipe = Recipe(strands=STRANDS, vertices=VERTICES, basis="bezier", bound="mesh")
    shot, told = write_shot(tmp_path, recipe), []
    bake(shot, tmp_path / "bake.usdc", model, tell=told.extend)
    needed = "12 points, where bezier curves (pinned) need 4, 7, 10 and so on"
    assert sum(needed in note for note in told) == sum(needed in note for note in inspect(shot)["spoils"]) == 1
