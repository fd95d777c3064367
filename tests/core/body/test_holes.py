# SPDX-License-Identifier: Apache-2.0
"""Holes of heads: closed where they are small, whichever way files split a skin."""

import numpy as np
import pytest
import trimesh

from neuralocks_core.body import holes
from neuralocks_core.body.enclosed import enclosed

RADIUS = 0.12


def cut(above: float):
    """Points and faces of a ball without what reaches above a height."""
    ball = trimesh.creation.icosphere(3, RADIUS)
    points, faces = np.array(ball.vertices), np.array(ball.faces)
    return points, faces[(points[faces][:, :, 1] <= above).all(axis=1)]


def closed_holes(points, faces, turn=None, head=True):
    """Lids of a turned mesh that is the head's or not."""
    return holes.closed_holes(points if turn is None else points @ turn.T, faces, np.full(len(points), head))


@pytest.mark.parametrize("seams", [False, True])
def test_a_scalp_that_is_not_there_is_closed(seams):
    """Outward, also where no two faces share a vertex; with no vertex of its own, the lid moves with the rim."""
    points, faces = cut(0.8 * RADIUS)
    if seams:
        points, faces = points[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    lid = closed_holes(points, faces)
    assert 0 < len(lid) < 60
    whole = trimesh.Trimesh(points, np.concatenate([faces, lid]), process=False)
    whole.merge_vertices()
    assert whole.is_watertight and whole.is_winding_consistent and whole.volume > 0.8 * 4 / 3 * np.pi * RADIUS**3
    normals = np.cross(points[lid[:, 1]] - points[lid[:, 0]], points[lid[:, 2]] - points[lid[:, 0]])
    assert normals[:, 1].sum() > 0.9 * np.linalg.norm(normals, axis=1).sum()
    just_below = np.array([[0.0, 0.7 * RADIUS, 0.0]])
    assert enclosed(just_below, points, np.concatenate([faces, lid])).all()


@pytest.mark.parametrize("above", [0.0, -0.5 * RADIUS])
def test_a_bowl_stays_open(above):
    """What is mostly rim, such as an eyebrow or a skirt, has nothing inside; nor has a closed mesh a hole."""
    assert len(closed_holes(*cut(above))) == 0
    assert len(closed_holes(*cut(RADIUS))) == 0


def test_what_has_something_in_it_stays_open():
    """A collar, which is not the head's, and a hat, which is open below; the ear of a head is at its side."""
    points, faces = cut(0.8 * RADIUS)
    down, aside = np.diag([1.0, -1.0, -1.0]), np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    assert len(closed_holes(points, faces, head=False)) == 0 == len(closed_holes(points, faces, down))
    assert len(closed_holes(points, faces, aside)) == len(closed_holes(points, faces)) > 0
    of_neck = np.ones(len(points), bool)
    of_neck[faces[points[faces][:, :, 1].max(axis=1).argmax()]] = False
    assert len(holes.closed_holes(points, faces, of_neck)) == 0


def test_holes_that_touch_stay_open():
    """Of rims that meet in one vertex, nothing says which belong together; other holes are closed."""
    points, faces = cut(RADIUS)
    around = np.flatnonzero((faces == faces[0, 0]).any(axis=1))
    apart = [face for face in around[1:] if len(np.intersect1d(faces[face], faces[around[0]])) == 1]
    far = int(points[faces].mean(axis=1)[:, 0].argmin())
    gone = [around[0], apart[0], far]
    lid = closed_holes(points, np.delete(faces, gone, axis=0))
    assert len(lid) == 1 and set(lid[0]) == set(faces[far])
