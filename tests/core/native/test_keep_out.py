# SPDX-License-Identifier: Apache-2.0
"""Compiled code keeps hair out of a body as numpy does, bit for bit: a farm's machines need not all have it."""

import numpy as np
import pytest
import trimesh

from neuralocks_core.body import moving_skin
from neuralocks_core.body.near_body import NearBody
from neuralocks_core.deformation import laying
from neuralocks_core.native import keep_out
from neuralocks_core.native.library import library
from neuralocks_core.skinned_body import Body
from tests.core.deformation.ball_hair import HEAD, strands

LOW, HIGH = np.full(3, -0.4), np.full(3, 0.4)
WAIST = trimesh.Trimesh(HEAD.vertices * (1 - 0.4 * np.exp(-np.square(HEAD.vertices[:, 1:2] / 0.03))), HEAD.faces)

pytestmark = pytest.mark.skipif(library() is None, reason="there is no compiled library for this machine")


@pytest.fixture(params=["still", "moving", "both"])
def near(request):
    """Bodies with a grid, with samples, and with the one above and the other below."""
    still = {"still": lambda y: y < np.inf, "moving": lambda y: y > np.inf, "both": lambda y: y > 0}[request.param]
    points, count = WAIST.vertices, len(WAIST.vertices)
    joints = (points[:, 1:2] <= 0).astype(int)
    return NearBody(Body(points, WAIST.faces, joints, np.ones((count, 1))), np.eye(4), still(points[:, 1]), LOW, HIGH)


def posed(near):
    turned = np.stack([np.eye(4), np.eye(4)])
    turned[1, :3, :3] = trimesh.transformations.rotation_matrix(0.2, [1, 0.3, 0])[:3, :3]
    return near.posed(turned, None, LOW, HIGH)


def without(monkeypatch):
    """As on a machine for which there is no library."""
    for module in (keep_out, moving_skin):
        monkeypatch.setattr(module, "library", lambda: None)


def hair(count=600):
    """Strands that curl into the body, and straight through it, with vertices that may rest in it."""
    rng = np.random.default_rng(7)
    curls = np.concatenate([strands(count, turn, seed) for seed, turn in enumerate((1.5, 0.9, 3.0))])
    straight = curls[:count, :1] * (1 - 0.1 * np.arange(24)[:, None]) + rng.normal(0, 1e-3, (count, 1, 3))
    points = np.concatenate([curls + rng.normal(0, 0.01, (3 * count, 1, 3)), straight]).astype(np.float32)
    return points, laying.clearance(rng.uniform(-0.03, 0.01, points.shape[:2]))


def test_strands_are_laid_the_same(near, monkeypatch):
    points, clear = hair()
    rest, watch = np.float32(0.9) * points, (np.arange(len(points)) % 5).clip(max=2).astype(np.uint8)

    def kept():
        displacement, body = points - rest, posed(near)
        laying.keep_out(displacement, rest, clear, watch, body)
        return body.compiled(24) is not None, laying.resolved(points, body, clear), displacement

    compiled, found, displaced = kept()
    without(monkeypatch)
    plain, wanted, wanted_displaced = kept()
    moved = (found != points).any(axis=(1, 2))
    assert compiled and not plain and moved.sum() > 500 and not moved.all() and np.isfinite(found).all()
    assert found.tobytes() == wanted.tobytes() and displaced.tobytes() == wanted_displaced.tobytes()
    changed = (displaced != points - rest).any(axis=(1, 2))
    assert changed[watch == laying.CHECKED].any() and not changed[watch == laying.NEVER].any()


def test_numbers_of_any_type_are_read_as_what_they_are(near):
    points, clear = hair(50)
    rest, watch = np.float32(0.9) * points, np.full(len(points), laying.CHECKED, np.uint8)
    wanted = points - rest
    laying.keep_out(wanted, rest, clear, watch, posed(near))
    found = (points - rest).astype(float)
    laying.keep_out(found, rest, clear, watch.astype(int), posed(near))
    assert np.abs(wanted - (points - rest)).max() > 0.01
    np.testing.assert_allclose(found, wanted, atol=1e-6)
    found = points - rest
    laying.keep_out(found, rest, clear, watch.astype(int), posed(near))
    np.testing.assert_array_equal(found, wanted)


def test_skin_is_posed_the_same(near, monkeypatch):
    """What is arbitrary, a sample for cells that are far from all, is left out."""
    found = posed(near)
    without(monkeypatch)
    wanted = posed(near)
    assert found._marks.tobytes() == wanted._marks.tobytes()
    if wanted._skin is not None:
        assert found._skin.planes.tobytes() == wanted._skin.planes.tobytes()
        near_skin = np.flatnonzero(wanted._marks & moving_skin.SKIN)
        assert len(near_skin) > 1000
        np.testing.assert_array_equal(found._skin.start[near_skin], wanted._skin.start[near_skin])


def test_points_that_are_nowhere_near_are_left(near):
    points, clear = hair(20)
    for far in (1e6, 1e30, np.inf, np.nan):
        away = np.full_like(points, far)
        moved = away.copy()
        laying.keep_out(moved, points, clear, np.ones(len(points), np.uint8), posed(near))
        np.testing.assert_array_equal(moved, away)
        np.testing.assert_array_equal(laying.resolved(away, posed(near), clear), away)


def test_strands_of_other_lengths_are_laid_by_numpy(near):
    points, clear = hair(50)
    body = posed(near)
    assert body.compiled(20) is None
    found = laying.resolved(points[:, :20], body, clear[:, :20])
    wanted = laying._resolved(points[:, :20], body, clear[:, :20])
    assert found.tobytes() == wanted.tobytes() and (found != points[:, :20]).any()
