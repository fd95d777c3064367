# SPDX-License-Identifier: Apache-2.0
"""The coarse body that the solver meets: coarse where it is smooth, and outside of it is outside."""

import numpy as np
import trimesh

from neuralocks_core.body.collider import Collider
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.mesh import vertex_normals
from neuralocks_core.rotation import unit
from neuralocks_core.skinned_body import Body
from neuralocks_core.training.data.hair_body import hair_body, posed_over_time

from .. import rigs

CENTRE = np.array([0.0, 1.68, 0.0])
EAR = CENTRE + [0.13, 0.0, 0.0]


def person(mesh):
    count = len(mesh.vertices)
    body = Body(mesh.vertices, mesh.faces, np.full((count, 1), rigs.HEAD), np.ones((count, 1)), {})
    return Character(Skeleton(rigs.NAMES, rigs.PARENTS, rigs.bind()), body)


def test_a_smooth_head_becomes_coarse_and_hardly_moves():
    head = trimesh.creation.icosphere(subdivisions=5, radius=0.1)
    coarse = hair_body(person(head.apply_translation(CENTRE)), reach=0.9)
    assert len(coarse.points) < 0.2 * len(head.vertices)
    middles = coarse.points[coarse.triangles].mean(axis=1)
    assert np.abs(np.linalg.norm(middles - CENTRE, axis=1) - 0.1).max() < 1e-3


def test_hair_beside_an_ear_is_outside():
    """Both sides of an ear are in one cell; welded to a sheet, half of the hair beside it would count as inside."""
    head = trimesh.creation.icosphere(subdivisions=4, radius=0.1).apply_translation(CENTRE)
    ear = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    ear.apply_scale([0.002, 0.03, 0.02]).apply_translation(EAR)
    coarse = hair_body(person(trimesh.util.concatenate([head, ear])), reach=0.9)
    way = np.random.default_rng(0).normal(size=(400, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    beside = EAR + way * [[0.03, 0.05, 0.04]]
    beside = beside[np.linalg.norm(beside - CENTRE, axis=1) > 0.105]
    assert Collider(coarse.points, coarse.triangles).distance(beside, limit=0.1)[0].min() > 0


def test_every_vertex_has_a_normal_and_the_surface_stays_closed():
    """Of uneven triangles, some are welded into pairs that lie back to back, with a corner that has no other."""
    hull = trimesh.convex.convex_hull(0.09 * unit(np.random.default_rng(0).normal(size=(4000, 3)))).apply_translation(
        CENTRE
    )
    coarse = hair_body(person(hull), reach=0.9)
    normals = vertex_normals(coarse.points, coarse.triangles)
    assert ((coarse.points - CENTRE) * normals).sum(axis=1).min() > 0.9 * 0.09
    assert trimesh.Trimesh(coarse.points, coarse.triangles, process=False).is_watertight
    inner = CENTRE + 0.086 * unit(np.random.default_rng(1).normal(size=(2000, 3)))
    assert Collider(coarse.points, coarse.triangles).distance(inner, limit=0.1)[0].max() < 0


def test_a_body_posed_for_all_frames_is_posed_as_for_each():
    """Vertices follow several joints, some of them twice; others follow none of the first."""
    rng = np.random.default_rng(0)
    weights = rng.uniform(size=(30, 3))
    body = Body(
        rng.normal(size=(30, 3)),
        rng.integers(30, size=(10, 3)),
        rng.choice([1, 3, 4], (30, 3)),
        weights / weights.sum(axis=1, keepdims=True),
        {"tall": rng.normal(size=(30, 3)), "wide": rng.normal(size=(30, 3))},
    )
    skinning = np.tile(np.eye(4), (7, 6, 1, 1))
    skinning[..., :3, :] += 0.3 * rng.normal(size=(7, 6, 3, 4))
    for shape in (None, np.array([0.5, -0.3])):
        expected = [body.posed(each, shape) for each in skinning]
        np.testing.assert_allclose(posed_over_time(body, skinning, shape), expected, atol=1e-5)
