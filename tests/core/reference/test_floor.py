# SPDX-License-Identifier: Apache-2.0
"""A longer memory lowers the floor of what a method without state can reach."""

import numpy as np
import pytest

pytest.importorskip("warp", reason="the reference needs warp")

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.reference import simulate, stateless_floor
from tests.core.reference.swinging_heads import carried, groom, shaken, sphere


def test_floor_falls_with_history():
    rest, head = groom(8, curl=0), shaken(70)
    truth = simulate(rest, head).points
    short, long = (stateless_floor(rest, head, history=n, every=9, truth=truth) for n in (4, 40))
    assert long.median < 0.1 < short.median
    assert long.position_percent < short.position_percent


def test_with_a_body():
    rest, head = groom(4, curl=0), shaken(30)
    points, faces = sphere()
    floor = stateless_floor(rest, head, carried(head, points), faces, history=20, every=5)
    assert np.isfinite(floor.rms) and floor.frames.tolist() == [20, 25]


def test_short_clip_is_refused():
    with pytest.raises(NeuralocksError, match="longer"):
        stateless_floor(groom(2), shaken(10), history=20)
