# SPDX-License-Identifier: Apache-2.0
"""Normals, pieces and sides of meshes: analytic on balls; cards and cloth have no inside."""

import numpy as np
import trimesh

from neuralocks_core.mesh import connected_pieces, inside_out, vertex_normals


def test_normals_of_a_sphere_are_its_directions():
    ball = trimesh.creation.uv_sphere(radius=0.1, count=[40, 40])
    normals = vertex_normals(np.vstack([ball.vertices, np.ones(3)]), ball.faces)
    assert (normals[:-1] * ball.vertices).sum(axis=1).min() > 0.0999 and not normals[-1].any()
    np.testing.assert_allclose(vertex_normals(ball.vertices.astype(np.float32), ball.faces), normals[:-1], atol=1e-5)


def test_two_balls_and_a_loose_vertex_are_three_pieces():
    ball = trimesh.creation.icosphere(1, 0.1)
    count = len(ball.vertices)
    piece = connected_pieces(np.vstack([ball.faces, ball.faces + count]), 2 * count + 1)
    assert len({*piece}) == 3 and np.ptp(piece[:count]) == np.ptp(piece[count:-1]) == 0


def test_closed_and_cut_open_balls_are_judged_and_cards_are_not():
    ball = trimesh.creation.icosphere(2, 0.1)
    far = ball.vertices + [3.0, 5.0, -2.0]
    assert not inside_out(far, ball.faces) and inside_out(far, ball.faces[:, ::-1])
    cap = ball.faces[(ball.vertices[ball.faces][:, :, 1] > 0).all(axis=1)]
    assert not inside_out(far, cap) and inside_out(far, cap[:, ::-1])
    rng = np.random.default_rng(1)
    cards = rng.normal(size=(60, 3, 3)).reshape(-1, 3)
    faces = np.arange(180).reshape(-1, 3)
    assert not inside_out(cards, faces) and not inside_out(cards, faces[:, ::-1])
    assert not inside_out(cards, faces[:0])
