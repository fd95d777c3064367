# SPDX-License-Identifier: Apache-2.0
"""Inside and outside by winding numbers, in meshes that cut through themselves too."""

import numpy as np
import pytest
import trimesh

from neuralocks_core.body.collider import Collider
from neuralocks_core.body.enclosed import enclosed, proven_distances, without_air
from neuralocks_core.errors import NeuralocksError


def test_a_ball_two_balls_and_an_open_one():
    ball = trimesh.creation.icosphere(3, 0.1)
    points = np.random.default_rng(0).uniform(-0.2, 0.2, (800, 3))
    inside = np.linalg.norm(points, axis=1) < 0.1
    clear = np.abs(np.linalg.norm(points, axis=1) - 0.1) > 2e-3
    assert (enclosed(points, ball.vertices, ball.faces) == inside)[clear].all()
    lens = np.concatenate([ball.vertices, ball.vertices + [0.1, 0, 0]])
    faces = np.concatenate([ball.faces, ball.faces + len(ball.vertices)])
    both = inside | (np.linalg.norm(points - [0.1, 0, 0], axis=1) < 0.1)
    clear &= np.abs(np.linalg.norm(points - [0.1, 0, 0], axis=1) - 0.1) > 2e-3
    assert (enclosed(points, lens, faces) == both)[clear].all()
    hole = ball.faces[ball.triangles_center[:, 2] > -0.098]
    assert (enclosed(points, ball.vertices, hole) == inside)[clear & (points[:, 2] > -0.08)].all()


def test_an_open_bowl_encloses_what_it_goes_round_more_than_half():
    ball = trimesh.creation.icosphere(4, 0.1)
    bowl = ball.faces[ball.triangles_center[:, 1] < 0]
    heights = np.array([-0.09, -0.05, -0.015, 0.015, 0.04, 0.2])
    found = enclosed(heights[:, None] * [0, 1.0, 0], ball.vertices, bowl)
    np.testing.assert_array_equal(found, heights < 0)


def test_air_beside_a_crease_is_no_depth():
    """A sheet folded so far that it cuts through itself: past the fold, the nearest face faces away from the air there."""
    box = trimesh.creation.box((0.2, 0.2, 0.2)).subdivide().subdivide()
    points, inward = box.vertices.copy(), box.vertices[:, 0] > 0.09
    points[inward & (np.abs(points[:, 1]) < 0.04) & (np.abs(points[:, 2]) < 0.04), 0] -= 0.3  # dented through the back
    air = np.array([[-0.28, 0.0, 0.0], [-0.22, 0.01, 0.0]])
    assert (Collider(points, box.faces).distance(air)[0] < -0.01).all()
    assert (proven_distances(points, box.faces, air) > 0.01).all()


def test_a_limb_that_ends_in_a_trunk_hides_no_depth():
    """The nearest face is that of the limb's end, which faces the point."""
    trunk, limb = trimesh.creation.icosphere(4, 0.1), trimesh.creation.box((0.2, 0.06, 0.06))
    limb.apply_translation((0.15, 0, 0))  # it ends 5 cm in
    body = trimesh.util.concatenate([trunk, limb])
    points = np.array([[0.04, 0.0, 0.0], [0.045, 0.02, 0.01], [0.2, 0, 0], [0.0, 0.12, 0.0], [0.11, 0.05, 0.0]])
    assert (Collider(body.vertices, body.faces).distance(points[:2])[0] > 0).all()
    found = proven_distances(body.vertices, body.faces, points)
    np.testing.assert_allclose(found, [-0.06, np.linalg.norm(points[1]) - 0.1, -0.03, 0.02, 0.02], atol=1e-3)


def test_few_points_are_measured_as_many_are():
    """Few points are compared only with the triangles in their reach; far and near points, inside and outside."""
    ball = trimesh.creation.icosphere(4, 0.1)
    points = np.random.default_rng(1).uniform(-0.13, 0.13, (200, 3))
    every = proven_distances(ball.vertices, ball.faces, points)
    few = np.concatenate([proven_distances(ball.vertices, ball.faces, some) for some in np.split(points, 50)])
    near = every < 0.03
    np.testing.assert_allclose(few[near], every[near], atol=1e-9)
    assert (few[~near] > 0.029).all()


def test_what_is_scaled_to_a_point_is_no_surface():
    """A part that a rig hides may collapse in the body or in the air, nearer to a point than the skin."""
    ball = trimesh.creation.icosphere(4, 0.1)
    points = np.array([[0.0, 0.0, 0.08], [0.0, 0.0, 0.13]])
    wanted = proven_distances(ball.vertices, ball.faces, points)
    hidden = np.concatenate([ball.vertices, np.repeat(points + 1e-3, 3, axis=0)])
    faces = np.concatenate([ball.faces, len(ball.vertices) + np.arange(6).reshape(2, 3)])
    np.testing.assert_array_equal(proven_distances(hidden, faces, points), wanted)
    assert proven_distances(ball.vertices, ball.faces, np.zeros((0, 3))).shape == (0,)
    with pytest.raises(NeuralocksError, match="no triangle with an area"):
        proven_distances(hidden, faces[-2:], points)


@pytest.mark.parametrize("count", [10, 30], ids=["few points", "many"])
def test_what_is_scaled_to_a_line_encloses_nothing(count):
    """Rounding leaves it a volume, of either sign, and points beside a slanting line are within its bounds."""
    ball, rng = trimesh.creation.icosphere(3, 0.1), np.random.default_rng(0)
    points = rng.uniform(-0.12, 0.12, (count, 3))
    wanted = proven_distances(ball.vertices, ball.faces, points)
    for way in rng.normal(size=(8, 3)):
        line = np.outer(ball.vertices[:, 0], 2 * way / np.linalg.norm(way))
        faces = np.concatenate([ball.faces, len(line) + ball.faces])
        found = proven_distances(np.concatenate([ball.vertices, line]), faces, points)
        np.testing.assert_array_equal(found, wanted)


def test_air_before_an_open_end_is_no_depth_and_what_is_enclosed_stays_as_deep():
    """A ball, and beside it a tube that is open at both ends, as locks of mesh hair are."""
    ball, tube = trimesh.creation.icosphere(4, 0.1), trimesh.creation.cylinder(0.03, 0.1, sections=24)
    sides = tube.faces[np.abs(tube.face_normals[:, 2]) < 0.5]
    vertices = np.concatenate([ball.vertices, tube.vertices + [0.4, 0, 0]])
    faces = np.concatenate([ball.faces, sides + len(ball.vertices)])
    heights = np.array([0.06, 0.08, 0.081, 0.12])
    points = np.concatenate(
        [heights[:, None] * [0, 0, 1.0] + [0.402, 0, 0], [[0.0, 0.02, 0], [0.06, 0, 0], [0.2, 0, 0]]]
    )
    seeming = Collider(vertices, faces).distance(points)[0]
    assert (seeming[:6] < -0.01).all() and seeming[6] > 0
    doubted = (seeming < 0).reshape(7, 1)
    found = without_air(seeming.reshape(7, 1), points.reshape(7, 1, 3), doubted, vertices, faces)[:, 0]
    np.testing.assert_array_equal(found[:4], -seeming[:4])
    np.testing.assert_array_equal(found[4:], seeming[4:])
