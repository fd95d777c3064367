# SPDX-License-Identifier: Apache-2.0
"""Distances to a mesh are exact, know inside from outside, and cost bounded memory; bad meshes are named."""

import numpy as np
import pytest
import trimesh

from neuralocks_core.body import collider, tree_search
from neuralocks_core.body.collider import Collider, closest_on_triangle
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import from_vector


def bumpy(seed=0):
    """A closed, star-shaped mesh with triangles of many sizes."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    direction = mesh.vertices / 0.1
    radius = 1 + 0.3 * np.sin(5 * direction[:, 0]) * np.cos(4 * direction[:, 1] + seed)
    mesh.vertices = mesh.vertices * radius[:, None] * [1, 1.6, 0.7]
    return mesh


def test_distance_agrees_with_trimesh():
    """Two implementations, on points near, far, inside and outside."""
    mesh, rng = bumpy(), np.random.default_rng(1)
    points = rng.uniform(-0.25, 0.25, (1500, 3))
    ours = Collider(mesh.vertices, mesh.faces)
    distance, direction = ours.distance(points, limit=1.0)
    np.testing.assert_allclose(distance, -trimesh.proximity.signed_distance(mesh, points), atol=1e-7)
    on_surface = points - distance[:, None] * direction
    np.testing.assert_allclose(ours.distance(on_surface)[0], 0, atol=1e-9)


def test_limit_keeps_near_points_exact_and_far_points_signed():
    mesh, rng = bumpy(2), np.random.default_rng(2)
    ours, points = Collider(mesh.vertices, mesh.faces), rng.uniform(-0.3, 0.3, (2000, 3))
    exact, _ = ours.distance(points, limit=1.0)
    limited, _ = ours.distance(points, limit=0.02)
    near = np.abs(exact) < 0.02
    np.testing.assert_array_equal(limited[near], exact[near])
    assert np.abs(limited - exact).max() < 0.01
    assert (np.sign(limited) == np.sign(exact)).mean() > 0.999


def test_memory_is_bounded_though_many_points_need_many_triangles(monkeypatch):
    """From the middle of a ball, all triangles are about equally far."""
    ball, rng = trimesh.creation.icosphere(subdivisions=3, radius=0.1), np.random.default_rng(4)
    points = rng.normal(0, 1e-5, (200, 3))
    told = Collider(ball.vertices, ball.faces).distance(points)[0]
    asked = []

    class Tree(tree_search.cKDTree):
        def query(self, x, k=1, **options):
            asked.append(len(x) * np.size(k))
            return super().query(x, k, **options)

    monkeypatch.setattr(tree_search, "cKDTree", Tree)
    monkeypatch.setattr(collider, "CANDIDATES", 5000)
    found = Collider(ball.vertices, ball.faces).distance(points)[0]
    assert len(asked) > 10 and max(asked) <= 5000
    np.testing.assert_array_equal(found, told)


def test_among_large_and_tiny_triangles_the_nearest_is_found():
    """Some samples stand for a hundred times as much surface as others: those of a triangle may be farther than many others."""
    rng = np.random.default_rng(11)
    sizes = 10 ** rng.uniform(-3, -0.5, 400)
    corners = rng.normal(0, 0.2, (400, 1, 3)) + sizes[:, None, None] * rng.normal(size=(400, 3, 3))
    mesh = Collider(corners.reshape(-1, 3), np.arange(1200).reshape(-1, 3))
    points = rng.normal(0, 0.3, (500, 3))
    places = closest_on_triangle(points[:, None], *np.moveaxis(mesh.points[mesh.triangles], 1, 0))[0]
    wanted = np.linalg.norm(places - points[:, None], axis=-1)
    distance, _, triangle = mesh.closest(points, limit=np.inf)
    np.testing.assert_allclose(np.abs(distance), wanted.min(axis=1), atol=1e-12)
    np.testing.assert_allclose(wanted[np.arange(500), triangle], wanted.min(axis=1), atol=1e-12)


def test_points_far_beyond_a_sharp_rim_are_not_inside():
    """The nearest sample there is on a face that may face away."""
    cone, rng = trimesh.creation.cone(0.01, 0.1, sections=16), np.random.default_rng(7)
    angle, radius = rng.uniform(0, 2 * np.pi, 2000), rng.uniform(0.05, 0.08, 2000)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), rng.uniform(0, 0.004, 2000)], axis=1)
    assert Collider(cone.vertices, cone.faces).distance(points, limit=0.02)[0].min() > 0.03


def test_hard_edges_and_seams_divide_no_surface():
    """Files have a vertex once for each face with a normal or a texture of its own: beyond a sharp edge, one of these faces away."""
    corners = np.array([[x, y * x, z] for z in (0, 0.1) for x, y in ((0, 0), (0.1, 0.1), (0.1, -0.1))])
    wedge = trimesh.convex.convex_hull(corners)
    apart = Collider(wedge.triangles.reshape(-1, 3), np.arange(3 * len(wedge.faces)).reshape(-1, 3))
    points = np.random.default_rng(8).uniform(-0.03, 0.13, (3000, 3))
    distance = Collider(wedge.vertices, wedge.faces).distance(points, limit=1)[0]
    np.testing.assert_allclose(apart.distance(points, limit=1)[0], distance, atol=1e-9)
    on = np.concatenate([wedge.vertices, wedge.triangles[:, :2].mean(axis=1)])
    distance, direction = apart.distance(on)
    np.testing.assert_allclose(distance, 0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, atol=1e-9)


def test_a_sheet_with_a_back_encloses_nothing():
    """Two squares on each other that face away from each other: beside them is air, also where their normals only nearly cancel, and
    before each.
    """
    square = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]])
    beside = np.array([[0.13, 0.05, -0.01], [0.13, 0.05, 0.01], [-0.02, -0.02, -0.02], [-0.02, -0.02, 0.02]])
    before = np.array([[0.07, 0.04, 0.03], [0.07, 0.04, -0.03], [0.05, 0.05, 0.03], [0.05, 0.05, -0.03]])
    for turn in [np.eye(3), *from_vector(np.random.default_rng(0).normal(size=(8, 3)))]:
        points = np.concatenate([square, square]) @ turn.T
        sheet = Collider(points, np.array([[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]]))
        assert (sheet.distance(beside @ turn.T)[0] > 0.02).all()
        np.testing.assert_allclose(sheet.distance(before @ turn.T)[0], 0.03, atol=1e-12)


def test_what_lies_beyond_an_open_edge_is_known_and_a_seam_is_none():
    """A square sheet of 2 m that faces up, cut along x = 0, where its corners are there twice."""
    x, y = np.array([-1, 0, 0, 1.0]), np.array([-1, 0, 1.0])
    points = np.stack([*np.meshgrid(x, y, [0.0], indexing="ij")], -1).reshape(-1, 3)
    left = np.array([[0, 3, 4], [0, 4, 1], [1, 4, 5], [1, 5, 2]])
    sheet = Collider(points, np.concatenate([left, left + 6]))
    below = np.array(
        [[0, 0.3, -0.2], [0, 0, -0.2], [0.4, 0.3, -0.2], [1.2, 0.3, -0.1], [-1.1, -1.1, -0.1], [0, 1.1, -0.1]]
    )
    distance, _, nearest = sheet.closest(below)
    assert (distance < 0).all()
    assert sheet.at_open_edge(below, nearest).tolist() == [False, False, False, True, True, True]


def test_box_is_analytic_with_two_huge_triangles_a_side():
    """Large triangles are found by points near their middle and near their corners."""
    mesh = trimesh.creation.box((2.0, 2.0, 2.0))
    rng = np.random.default_rng(3)
    points = rng.uniform(-1.5, 1.5, (3000, 3))
    outside = np.linalg.norm(np.maximum(np.abs(points) - 1, 0), axis=1)
    expected = np.where(outside > 0, outside, (np.abs(points) - 1).max(axis=1))
    np.testing.assert_allclose(Collider(mesh.vertices, mesh.faces).distance(points, limit=9)[0], expected, atol=1e-12)


def test_closest_point_covers_all_seven_features():
    a, b, c = np.eye(3)
    rng = np.random.default_rng(4)
    points = rng.normal(0.3, 1.5, (4000, 3))
    place, feature = closest_on_triangle(points, a, b, c)
    assert set(feature) == set(range(7))
    tri = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    np.testing.assert_allclose(place, trimesh.triangles.closest_point(tri, points), atol=1e-12)


@pytest.mark.parametrize(
    "points, triangles, said",
    [
        (np.full((3, 3), np.nan), [[0, 1, 2]], "not finite"),
        (np.eye(3), [[0, 1, 7]], "not there"),
        (np.zeros((3, 3)), [[0, 1, 2]], "no triangle"),
        (np.eye(3), np.zeros((0, 3)), "no triangle"),
    ],
)
def test_bad_meshes_are_named(points, triangles, said):
    with pytest.raises(NeuralocksError, match=said):
        Collider(points, triangles)


def test_no_points_give_no_distances():
    mesh = trimesh.creation.icosphere()
    distance, direction = Collider(mesh.vertices, mesh.faces).distance(np.zeros((0, 24, 3)))
    assert distance.shape == (0, 24) and direction.shape == (0, 24, 3)


@pytest.mark.parametrize(
    ("points", "limit"),
    ((np.zeros((4, 2)), 0.03), (np.full((1, 3), np.nan), 0.03), (np.ones((1, 3)), np.nan), (np.ones((1, 3)), -1.0)),
)
def test_points_and_limits_that_are_none_are_refused(points, limit):
    ball = trimesh.creation.icosphere(1)
    with pytest.raises(NeuralocksError, match="give finite points .*, a limit from 0"):
        Collider(ball.vertices, ball.faces).distance(points, limit=limit)
