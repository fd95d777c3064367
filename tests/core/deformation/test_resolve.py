# SPDX-License-Identifier: Apache-2.0
"""Hair leaves the body whether what it meets stands still (a grid) or moves (samples), strand by strand."""

import numpy as np
import pytest
import trimesh

from neuralocks_core.body.collider import Collider
from neuralocks_core.body.near_body import NearBody
from neuralocks_core.deformation.laying import MARGIN, clearance, resolved, rest_distance
from neuralocks_core.skinned_body import Body
from tests.core.deformation.ball_hair import HEAD, strands

EXACT = Collider(HEAD.vertices, HEAD.faces)


LOW, HIGH = np.full(3, -0.4), np.full(3, 0.4)


FREE = clearance(np.full((60, 24), 0.01))


def near_body(still, mesh=HEAD):
    count = len(mesh.vertices)
    body = Body(mesh.vertices, mesh.faces, np.zeros((count, 1), int), np.ones((count, 1)))
    return NearBody(body, np.eye(4), np.full(count, still), LOW, HIGH)


@pytest.fixture(scope="module", params=[True, False], ids=["still", "moving"])
def body(request):
    return near_body(request.param).posed(np.eye(4)[None], None, LOW, HIGH)


def test_distances_near_the_skin_are_those_of_the_sphere(body):
    rng = np.random.default_rng(3)
    away = rng.normal(size=(3000, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    depth = rng.uniform(-0.02, 0.008, 3000)
    value, direction = body.distance(((0.1 + depth)[:, None] * away).astype(np.float32))
    # Exact to a few tenths of a millimetre where hair is pushed to; deeper down, a way out is enough.
    error, near = np.abs(value - depth), depth > -0.006
    assert np.quantile(error[near], 0.99) < 6e-4 and error[near].max() < 1.5e-3 and error.max() < 4e-3
    assert (direction * away).sum(axis=1).min() > 0.987
    assert np.isinf(body.distance(np.full((5, 3), 0.3, np.float32))[0]).all()


def test_moving_skin_is_found_where_it_is():
    far = np.eye(4)
    far[:3, 3] = 0.05, 0.02, -0.03
    posed = near_body(False).posed(far[None], None, LOW, HIGH)
    away = np.random.default_rng(4).normal(size=(500, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    value, _ = posed.distance((0.104 * away + far[:3, 3]).astype(np.float32))
    assert np.abs(value - 0.004).max() < 1e-3


def test_hair_beside_the_head_is_not_below_the_skin_that_it_is_farther_from():
    """A collar around the head begins 17 mm from there: its plane continues, and hair would be pushed out of that."""
    ring = np.linspace(0, 2 * np.pi, 65)[:-1]
    rings = np.stack([np.cos(ring), np.sin(ring), 0 * ring], axis=1) * np.linspace(0.118, 0.15, 5)[:, None, None]
    faces = [
        [(r * 64 + c, (r + 1) * 64 + c, (r + 1) * 64 + d), (r * 64 + c, (r + 1) * 64 + d, r * 64 + d)]
        for r in range(4)
        for c, d in zip(range(64), [*range(1, 64), 0])
    ]
    points, count = np.concatenate([HEAD.vertices, rings.reshape(-1, 3)]), len(HEAD.vertices)
    triangles = np.concatenate([HEAD.faces, np.reshape(faces, (-1, 3)) + count])
    body = Body(points, triangles, np.zeros((len(points), 1), int), np.ones((len(points), 1)))
    posed = NearBody(body, np.eye(4), np.arange(len(points)) < count, LOW, HIGH).posed(np.eye(4)[None], None, LOW, HIGH)
    beside = (rings[0] / 0.118 * 0.101 - [0, 0, 0.003]).astype(np.float32)
    np.testing.assert_allclose(posed.distance(beside)[0], 0.001, atol=5e-4)


def test_what_lies_behind_a_thin_part_is_not_below_its_front():
    # As thick as a shoulder: distances to its front are known down to where its back is already far.
    slab = trimesh.creation.box((0.3, 0.3, 0.02)).subdivide_to_size(0.015)
    posed = near_body(False, slab).posed(np.eye(4)[None], None, LOW, HIGH)
    rng = np.random.default_rng(5)
    points = rng.uniform([-0.14, -0.14, -0.06], [0.14, 0.14, 0.06], (5000, 3)).astype(np.float32)
    depth, value = np.abs(points[:, 2]) - 0.01, posed.distance(points)[0]
    assert (value[depth > 0] > -0.002).all()
    assert (value[depth < 0] < 0).all()


def test_the_sieve_finds_every_strand_that_is_inside(body):
    points = strands(300, seed=5)
    low = clearance(np.full((300, 24), 0.01)) - np.float32(1e-5)
    inside = (EXACT.distance(points, limit=0.02)[0][:, 2:] < 0).any(axis=1)
    assert 0.1 < inside.mean()
    assert set(np.flatnonzero(inside)) <= set(body.violated(points, low))
    assert not len(body.violated(strands(turn=0.0) * np.float32(1.5), low[:60]))


def test_no_vertex_stays_inside_and_lengths_are_kept(body):
    before = strands()
    assert (EXACT.distance(before)[0] < 0).mean() > 0.05
    after = resolved(before, body, FREE)
    assert EXACT.distance(after)[0][:, 2:].min() > 0
    lengths = np.linalg.norm(np.diff(before, axis=1), axis=2)
    np.testing.assert_allclose(np.linalg.norm(np.diff(after, axis=1), axis=2), lengths, atol=2e-7)
    np.testing.assert_array_equal(after[:, :2], before[:, :2])


def test_strands_do_not_depend_on_each_other(body):
    before = strands()
    whole = resolved(before, body, FREE)
    order = np.random.default_rng(1).permutation(60)
    np.testing.assert_array_equal(resolved(before[order], body, FREE)[np.argsort(order)], whole)
    np.testing.assert_array_equal(resolved(before[20:33], body, FREE[20:33]), whole[20:33])


def test_hair_that_rests_inside_is_not_pushed_beyond_its_rest(body):
    before = strands()
    clear = clearance(body.distance(before)[0])
    np.testing.assert_array_equal(resolved(before, body, clear), before)
    assert not len(body.violated(before, clear - np.float32(1e-5)))


def chords(count=60, seed=6):
    """Straight strands that go in at one side of the sphere and out at the other, 50 to 90 mm below the skin."""
    away = np.random.default_rng(seed).normal(size=(count, 2, 3))
    away /= np.linalg.norm(away, axis=2, keepdims=True)
    middle, side = away[:, 0], np.cross(away[:, 0], away[:, 1])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    along = np.linspace(-0.12, 0.13, 24)[None, :, None]
    return (np.linspace(0.01, 0.05, count)[:, None, None] * middle[:, None] + along * side[:, None]).astype(np.float32)


def test_hair_that_rests_deep_inside_is_left_there(body):
    """However deep: where nothing is known of the body, hair is not taken as free, and not dragged out."""
    before = chords()
    exact, found = EXACT.distance(before)[0], rest_distance(before, body)
    deep = exact < -0.01
    assert found[deep].max() < -0.005 and (np.minimum(found, 0) - np.minimum(exact, 0) < 5e-3).all()
    clear = clearance(found)
    np.testing.assert_array_equal(resolved(before, body, clear), before)
    moved = before + np.float32(0.004) * np.random.default_rng(7).normal(size=(60, 1, 3)).astype(np.float32)
    moved[:, :2] = before[:, :2]
    after = resolved(moved, body, clear)
    assert np.median(np.linalg.norm(after - moved, axis=2).max(axis=1)) < 0.01
    assert EXACT.distance(after)[0][exact < -0.045].max() < -0.02


@pytest.mark.parametrize("rests", [-0.005, -0.02, -0.034])
def test_hair_comes_back_to_the_depth_at_which_it_rests(body, rests):
    before = strands(turn=0.5)
    away = before / np.linalg.norm(before, axis=2, keepdims=True)
    around = np.float32(0.1 + rests) * away
    clear = clearance(np.full((60, 24), rests))
    lowered = around - np.float32(0.004) * away * (np.arange(24) > 2)[:, None]
    after = resolved(lowered, body, clear)
    assert body.distance(lowered)[0].min() < rests - 0.003
    # Nearer than half a margin is near enough; where a strand has to turn back sharply, the rounds are not enough.
    assert np.quantile((rests - body.distance(after)[0][:, 2:]).max(axis=1), 0.9) < 0.55 * MARGIN


def test_no_strand_is_left_deeper_than_it_was():
    """Curls in a thin body, where the way out alternates between the sides: they are not made worse."""
    thin = np.float32([1, 1, 0.2])
    body = near_body(True, trimesh.Trimesh(HEAD.vertices * thin, HEAD.faces)).posed(np.eye(4)[None], None, LOW, HIGH)
    edges = np.random.default_rng(8).normal(size=(2000, 23, 3))
    edges = 0.5 * edges + 0.3 * np.cumsum(edges, axis=1)
    edges *= 0.012 / np.linalg.norm(edges, axis=2, keepdims=True)
    roots = strands(2000)[:, :1] * thin
    before = np.concatenate([roots, roots + np.cumsum(edges, axis=1)], axis=1).astype(np.float32)
    clear = clearance(np.full((2000, 24), -0.004))
    after = resolved(before, body, clear)
    was, left = ((clear - body.distance(points)[0])[:, 2:].max(axis=1) for points in (before, after))
    assert (left > 0.002).any(), "all were freed: nothing is tested"
    assert (left < was + 2e-4)[left > 0.5 * MARGIN + 2e-5].all()


@pytest.mark.parametrize("shift", [0.0005, 0.002, 0.01])
def test_small_violations_make_small_corrections(body, shift):
    """Pushed hair moves by about as much as it was deep: no popping."""
    before = strands(turn=0.0)
    lowered = before.copy()
    lowered[:, 2:] -= np.float32(shift) * before[:, 2:] / np.linalg.norm(before[:, 2:], axis=2, keepdims=True)
    after = resolved(lowered, body, FREE)
    assert np.abs(after - lowered).max() < 4 * (shift + MARGIN)


def test_hair_slides_over_the_skin_without_jumps(body):
    """A strand that is lowered in steps of 0.2 mm follows in steps of the same order."""
    before = strands(40, turn=0.8, seed=2)
    steps = [before - np.float32(2e-4 * i) * np.array([0, 1, 0], np.float32) for i in range(25)]
    moved = np.stack([resolved(step, body, FREE[:40]) for step in steps])
    jump = np.linalg.norm(np.diff(moved, axis=0), axis=-1)
    assert np.quantile(jump, 0.99) < 1e-3 and jump.max() < 8e-3
