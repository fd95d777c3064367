# SPDX-License-Identifier: Apache-2.0
"""Meshes whose faces look inward are told from others, and from cards and cloth that have no inside."""

import numpy as np
import trimesh

from neuralocks_core.winding import inside_out


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
