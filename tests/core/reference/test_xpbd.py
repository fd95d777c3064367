# SPDX-License-Identifier: Apache-2.0
"""The baseline, and two solvers that share nothing but the energies against each other."""

import numpy as np
import pytest

pytest.importorskip("warp", reason="the reference needs warp")

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.reference import simulate, simulate_xpbd
from tests.core.reference.swinging_heads import carried, edge_lengths, groom, shaken, sphere


def test_small_steps_and_newton_agree():
    """Substeps up, explicit XPBD and implicit Newton tend to one motion: same bend, support, damping, inertia."""
    rest, head = groom(20, curl=0), shaken(30)
    newton = simulate(rest, head, substeps=8, tolerance=1e-5).points
    moved = np.linalg.norm(newton - rest, axis=-1).mean()
    error = [
        np.linalg.norm(simulate_xpbd(rest, head, substeps=n).points - newton, axis=-1).mean() / moved for n in (15, 50)
    ]
    assert error[1] < 0.1 < error[0]


def test_curls_agree():
    """Curvature is carried along the same twist-free frame."""
    rest, head = groom(20, curl=0.6), shaken(30, 0.4)
    newton = simulate(rest, head, substeps=8, tolerance=1e-5).points
    moved = np.linalg.norm(newton - rest, axis=-1).mean()
    small = simulate_xpbd(rest, head, substeps=80).points
    assert np.linalg.norm(small - newton, axis=-1).mean() < 0.15 * moved


def test_bind_pose_and_constant_speed():
    """What is left is the stretch that one pass a substep leaves."""
    rest = groom(8)
    head = np.tile(np.eye(4), (6, 1, 1))
    head[:, 0, 3] = np.arange(6) / 30
    points, faces = sphere(0.1005)
    result = simulate_xpbd(rest, head, carried(head, points), faces, bind_body=points, substeps=100)
    assert np.abs(result.points - rest).max() < 1e-3


def test_stretch_shrinks_with_substeps_and_nothing_breaks():
    rest, head = groom(8, curl=0.8), shaken(20, 1.5)
    stretch = []
    for substeps in (10, 40):
        points = simulate_xpbd(rest, head, substeps=substeps).points.astype(float)
        assert np.isfinite(points).all()
        stretch.append(np.abs(edge_lengths(points) / edge_lengths(rest) - 1).mean())
    assert stretch[1] < 0.3 * stretch[0]


def test_no_substeps_is_refused():
    with pytest.raises(NeuralocksError, match="substeps"):
        simulate_xpbd(groom(2), np.eye(4)[None], substeps=0)
