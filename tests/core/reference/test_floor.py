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


def test_wind_blows_in_restarts_as_it_does_in_the_clip():
    """Each restart in the wind of its own frames."""
    rest, head = groom(4, curl=0), np.tile(np.eye(4), (45, 1, 1))
    wind = np.zeros((45, 3))
    wind[:30, 0], wind[30:, 2] = 4.0, 4.0
    floor = stateless_floor(rest, head, wind=wind, history=30, every=10)
    assert floor.position_percent < 0.5
    calm = stateless_floor(rest, head, truth=simulate(rest, head, wind=wind).points, history=30, every=10)
    assert calm.position_percent > 10 * floor.position_percent


def test_frames_ahead_shape_the_motion_before_in_restarts_too():
    """They were compared themselves, or the restarts ended so many frames early."""
    rest, head = groom(2, curl=0), shaken(34)
    told = []
    floor = stateless_floor(
        rest, head, history=25, every=5, ahead=3, substeps=2, progress=lambda *done: told.append(done)
    )
    assert told == [(1, 2, "restarting"), (2, 2, "restarting")]
    assert floor.frames.tolist() == [25, 30] and floor.rms < 0.2


@pytest.mark.parametrize(
    ("changed", "fact"),
    [
        ({"truth": np.zeros((3, 2, 24, 3))}, r"truth: is of shape \(3, 2, 24, 3\); give"),
        ({"truth": "all"}, "truth: is not an array of numbers"),
        ({"history": 10.0}, "history 10.0, every 10: give whole numbers"),
        ({"every": True}, "every True: give whole numbers"),
        ({"history": 0}, "a history of 0 looked at every 10"),
        ({"every": 0}, "a history of 20 looked at every 0"),
        ({"history": 30}, "40 frames for a history of 30 looked at every 10; give a longer clip"),
    ],
)
def test_what_does_not_fit_is_named(changed, fact):
    with pytest.raises(NeuralocksError, match=fact):
        stateless_floor(groom(2), shaken(40), **{"history": 20} | changed)


def test_short_clip_is_refused():
    with pytest.raises(NeuralocksError, match="longer"):
        stateless_floor(groom(2), shaken(10), history=20)
    with pytest.raises(TypeError, match="history"):  # it has no default length: each model reads its own
        stateless_floor(groom(2), shaken(10))
