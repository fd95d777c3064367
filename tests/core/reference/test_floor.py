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


def test_restarts_measure_rest_on_the_body_at_rest():
    """Not on the body as it is posed where they begin, to which hair would then be pushed."""
    rest, head = groom(4, curl=0), shaken(30)
    points, faces = sphere()
    posed = carried(head, points) + np.linspace(0, 0.03, 30)[:, None, None] * [1, 0, 0]
    floor, told = (
        stateless_floor(rest, head, posed, faces, history=20, every=5, **known) for known in ({}, {"bind_body": points})
    )
    assert np.isfinite(floor.rms) and floor.frames.tolist() == [20, 25]
    assert floor.rms == pytest.approx(told.rms, rel=1e-4)


def test_short_clip_is_refused():
    with pytest.raises(NeuralocksError, match="longer"):
        stateless_floor(groom(2), shaken(10), history=20)
    with pytest.raises(TypeError, match="history"):  # it has no default length: each model reads its own
        stateless_floor(groom(2), shaken(10))
