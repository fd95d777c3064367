# SPDX-License-Identifier: Apache-2.0
"""Distances to posed bodies while hair on bones learns: those of the exact search, for coarse and fine meshes."""

import numpy as np
import pytest
import trimesh

from neuralocks_core.body import surface_samples
from neuralocks_core.body.collider import Collider
from neuralocks_core.body.surface_samples import SurfaceSamples, nearest
from neuralocks_core.mesh import welded_vertices
from neuralocks_core.rotation import from_vector

RADIUS = 0.12


def distances(samples: SurfaceSamples, vertices: np.ndarray, points: np.ndarray) -> np.ndarray:
    read = vertices[samples.vertices]
    found = nearest(samples.index(read), points)
    normals, offsets = samples.planes(found, points, read[None])
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
    return (points * normals).sum(axis=1) - offsets


def around(vertices, triangles, rng, reach=0.02):
    """Points within a reach of a surface, on both sides."""
    on = vertices[triangles].mean(axis=1)[rng.integers(0, len(triangles), 600)]
    return on + rng.uniform(-reach, reach, on.shape)


@pytest.mark.parametrize(
    ("mesh", "worst"),
    [
        (trimesh.creation.box((0.2, 0.24, 0.2)), 1e-6),
        (trimesh.creation.icosphere(1, RADIUS), 1e-6),
        (trimesh.creation.icosphere(3, RADIUS), 1e-3),
    ],
    ids=["twelve faces", "a coarse ball", "a fine ball"],
)
def test_distances_are_the_exact_ones_in_any_pose(mesh, worst):
    """Also with seams, along which faces share no vertices. The plane of the nearest vertex is off by centimetres on such a box."""
    points, triangles = np.array(mesh.vertices), np.array(mesh.faces)
    split = points[triangles].reshape(-1, 3)
    for vertices, faces in ((points, triangles), (split, np.arange(len(split)).reshape(-1, 3))):
        samples, (first, place) = SurfaceSamples(vertices, faces, 600), welded_vertices(vertices)
        posed = vertices * (1.1, 0.95, 1.0) @ from_vector(np.array([0.4, 0.2, -0.3])).T + (0.1, 0.2, 0.0)
        some = around(posed, faces, np.random.default_rng(0))
        exact = Collider(posed[first], place[faces]).distance(some)[0]
        found = distances(samples, posed, some)
        assert (exact < -0.005).sum() > 50 and (exact > 0.005).sum() > 50
        assert np.quantile(np.abs(found - exact), 0.99) < worst


def test_nothing_is_inside_beyond_an_open_edge():
    """Of a bowl, whose inner side is 'inside': above its rim, no side is; so at the cut of a body to its part around the head."""
    ball = trimesh.creation.icosphere(3, RADIUS)
    faces = np.array(ball.faces)[(ball.vertices[:, 1] < 1e-6)[ball.faces].all(axis=1)]
    samples = SurfaceSamples(np.array(ball.vertices), faces, 600)
    below, above = (np.array([[0.02, y, 0.01], [-0.03, y, 0.0]]) for y in (-0.1, 0.1))
    inside, over = (distances(samples, np.array(ball.vertices), some) for some in (below, above))
    assert (inside < 0).all() and (over > 1).all()


def test_in_front_of_a_thin_part_is_hardly_ever_inside(monkeypatch):
    """As of an ear: the faces around the nearest place may all be of its far side."""
    thin = trimesh.creation.icosphere(4, 0.04)
    vertices, triangles = np.array(thin.vertices) * [0.04, 1, 1], np.array(thin.faces)
    rng = np.random.default_rng(0)
    points = vertices[rng.integers(0, len(vertices), 4000)]
    points += rng.uniform([0.005, -0.01, -0.01], [0.03, 0.01, 0.01], points.shape) * np.where(
        points[:, :1] < 0, [-1, 1, 1], 1
    )

    def seem_inside() -> int:
        return (distances(SurfaceSamples(vertices, triangles, 300), vertices, points) < 0).sum()

    found = seem_inside()
    monkeypatch.setattr(surface_samples, "WIDELY", surface_samples.AROUND)
    assert found <= 2 and seem_inside() > 20
