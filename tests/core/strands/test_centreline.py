# SPDX-License-Identifier: Apache-2.0
"""Coils finer than the network's vertices become the line they wind around; everything else stays."""

import numpy as np

from neuralocks_core.strands.centreline import SHARPEST, centre_lines, passes, smoothed


def coil(turns, radius=0.01, height=0.2, vertices=24):
    """(1, vertices, 3): a helix about the Y axis."""
    s = np.linspace(0, 1, vertices)
    angle = 2 * np.pi * turns * s
    return np.stack([radius * np.cos(angle), height * s, radius * np.sin(angle)], axis=-1)[None]


def corners(points):
    edges = np.diff(points, axis=1)
    edges /= np.linalg.norm(edges, axis=-1, keepdims=True)
    return np.arccos(np.clip((edges[:, :-1] * edges[:, 1:]).sum(-1), -1, 1))


def test_what_the_vertices_can_hold_stays_bit_for_bit():
    wave = coil(1.5)
    assert np.array_equal(centre_lines(wave), wave)


def test_a_tight_coil_becomes_its_axis():
    line = centre_lines(coil(9.3))
    assert corners(coil(9.3)).max() > SHARPEST
    assert corners(line).max() <= SHARPEST + 1e-9
    assert np.linalg.norm(line[0, 4:-4, [0, 2]], axis=0).max() < 0.005
    assert np.array_equal(line[:, [0, -1]], coil(9.3)[:, [0, -1]])


def test_what_moves_along_a_coil_is_smoothed_as_the_coil_was():
    both = np.concatenate([coil(9.3), coil(1.5), coil(11)])
    times = passes(both)
    assert times[1] == 0 < times[0] != times[2] > 0
    assert np.array_equal(smoothed(both, times), centre_lines(both))
