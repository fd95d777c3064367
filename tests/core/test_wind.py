# SPDX-License-Identifier: Apache-2.0
"""Wind: one function of time, and felt as a head that accelerates against it."""

import numpy as np
import pytest

from neuralocks_core import rotation
from neuralocks_core.boundary.history import BoundarySampler
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import Clip
from neuralocks_core.wind import ACROSS, Wind
from tests.core.rigs import bind, moved, person

SPEC = BoundarySpec()


def turning(t):
    return rotation.from_vector(np.stack([0.4 * np.sin(3 * t), 0.8 * np.sin(2 * t), 0 * t], axis=-1))


def test_without_gusts_it_is_steady():
    assert np.array_equal(Wind((1, 2, -3), 0.0).at([0.0, 7.3, -1e3]), np.tile([1.0, 2, -3], (3, 1)))


def test_the_same_numbers_are_the_same_wind():
    """However they were given; files of USD and JSON take them as they are kept."""
    given = Wind(np.float32([1, 2, -3]))
    assert given == Wind((1, 2, -3)) and hash(given) == hash(Wind([1, 2, -3]))
    assert [type(number) for number in given.mean] == [float] * 3


def test_gusts_vary_it_by_their_share_and_leave_its_mean():
    wind = Wind((0, 0, 4), 0.75)
    blown = wind.at(np.arange(0, 600, 0.05))
    assert blown.mean(axis=0) == pytest.approx([0, 0, 4], abs=0.02)
    along, across = blown[:, 2], np.abs(blown[:, 0])
    assert 1.0 <= along.min() < 1.6 and 6.4 < along.max() <= 7.0
    assert 1.0 < across.max() <= 0.75 * ACROSS * 4
    assert (blown[:, 1] == 0).all()


def test_a_time_has_one_wind_however_it_is_asked_for():
    wind, times = Wind((3, 1, 2)), np.random.default_rng(0).uniform(-50, 50, (4, 5))
    each = [[wind.at(time) for time in row] for row in times]
    assert wind.at(times).tolist() == np.array(each).tolist()


@pytest.mark.parametrize("period", [0.7, 1.0, 5.5])
def test_in_a_loop_gusts_repeat(period):
    wind, times = Wind((2, 0, 1)), np.linspace(0, period, 40)
    blown = wind.at(times, period)
    assert wind.at(times + 3 * period, period) == pytest.approx(blown, abs=1e-9)
    assert np.ptp(blown, axis=0).max() > 0.25


@pytest.mark.parametrize("mean", [(0, 3, 0), (0, -2, 0)])
def test_a_wind_straight_up_or_down_has_gusts_across_too(mean):
    assert np.ptp(Wind(mean).at(np.arange(0, 9, 0.1))[:, 0]) > 0.5


@pytest.mark.parametrize(
    ("mean", "gusts", "said"),
    [
        ((6, 6, 6), 0.5, "is 10.4 m/s\\^2 strong; give at most 8"),
        ((np.nan, 0, 0), 0.5, "is not a vector"),
        ((1, 0), 0.5, "is not a vector"),
        ("strong", 0.5, "wind: is not an array of numbers; give three"),
        ((1, 0, 0), "0.5", "gusts 0.5: give a share"),
        ((1, 0, 0), 1.5, "gusts 1.5: give a share of the wind from 0 to 1"),
        ((1, 0, 0), np.nan, "gusts nan"),
        ((1, 0, 0), True, "gusts True"),
    ],
)
def test_what_is_no_wind_is_refused(mean, gusts, said):
    with pytest.raises(NeuralocksError, match=said):
        Wind(mean, gusts)


@pytest.mark.parametrize(
    ("times", "period", "said"),
    [
        ([0.0, np.nan], 0.0, "times: hold NaN or infinity"),
        (np.inf, 2.0, "times: hold NaN or infinity"),
        (["1"], 0.0, "times: is not an array of numbers"),
        ([0.0], np.inf, "period inf: give seconds"),
        ([0.0], np.nan, "period nan: give seconds"),
        ([0.0], -3, "period -3: give seconds"),
        ([0.0], "3", "period 3: give seconds"),
    ],
)
def test_times_and_periods_that_are_none_are_refused(times, period, said):
    with pytest.raises(NeuralocksError, match=said):
        Wind((1, 0, 0)).at(times, period)


def test_a_steady_wind_is_felt_as_a_head_that_accelerates_against_it():
    """Galilei: R^T (g + w) is what a head that accelerates by -w feels. The limit of 6 g is far away."""
    t, w = np.arange(0, 4, 1 / 60), np.array([2.0, 1.0, -3.0])
    pushed = BoundarySampler(SPEC, person(), moved(t, lambda t: -0.5 * np.outer(t**2, w), turning))
    blown = BoundarySampler(SPEC, person(), moved(t, None, turning)).vectors([2.0, 3.0], wind=Wind(tuple(w), 0.0))
    assert blown == pytest.approx(pushed.vectors([2.0, 3.0]), abs=2e-3)


def test_gusts_are_felt_when_they_blow():
    """A path whose second differences over the model's own steps are those of -w."""
    steps, wind = np.arange(120), Wind((3, 0, 2), 1.0)
    t = steps * SPEC.dt
    kicks = -wind.at(t) * SPEC.dt**2
    path = np.cumsum(np.cumsum(kicks, axis=0), axis=0)
    pushed = BoundarySampler(SPEC, person(), moved(t, lambda _: path, turning)).vectors(t[80:100])
    blown = BoundarySampler(SPEC, person(), moved(t, None, turning)).vectors(t[80:100], wind=wind)
    assert blown == pytest.approx(pushed, abs=2e-3)


def test_motion_strength_does_not_weaken_it():
    sampler = BoundarySampler(SPEC, person(), moved(np.arange(0, 3, 1 / 30), None, turning))
    times, wind = [1.0, 2.0], Wind((0, 0, 5))
    held, none = sampler.vectors(times, strength=0.0, wind=wind), sampler.vectors(times, strength=0.0)
    full = sampler.vectors(times, wind=wind) - sampler.vectors(times)
    assert held - none == pytest.approx(full, abs=1e-6)
    assert np.abs(full).max() > 0.3


def test_in_a_loop_the_wind_comes_round_with_the_motion():
    t = np.arange(61) / 30
    clip = moved(t, lambda t: np.stack([0.1 * np.sin(np.pi * t), 0 * t, 0 * t], -1), loop=True)
    first, second = BoundarySampler(SPEC, person(), clip).vectors([0.5, 2.5], wind=Wind((4, 0, 0), 1.0))
    assert second == pytest.approx(first, abs=1e-5)


def test_in_animation_on_twos_the_hair_holds_in_a_wind_as_the_pose_does():
    t = np.arange(96) / 24
    joints = np.tile(bind(), (len(t), 1, 1, 1))
    joints[:, :, 0, 3] += 0.3 * np.sin(3 * np.repeat(t[::2], 2))[:, None]
    sampler = BoundarySampler(SPEC, person(), Clip(t, joints))
    vectors = sampler.vectors(t[60:64], wind=Wind((4, 0, 0), 1.0))
    assert np.array_equal(vectors[0], vectors[1]) and np.array_equal(vectors[2], vectors[3])
    assert not np.array_equal(vectors[1], vectors[2])


@pytest.mark.parametrize("spec", [BoundarySpec(bins=()), BoundarySpec(linear="velocity"), BoundarySpec(linear="none")])
def test_a_model_without_a_history_of_gravity_refuses_it(spec):
    sampler = BoundarySampler(spec, person(), moved([0.0, 1.0]))
    assert not spec.feels_wind
    with pytest.raises(NeuralocksError, match="wind: this model is for held poses"):
        sampler.vectors([0.5], wind=Wind((1, 0, 0)))


def test_a_wind_from_another_side_is_the_same_wind_turned():
    times = np.linspace(0, 5, 40)
    turn = rotation.from_vector([0.0, 0.7, 0.0])
    mean = np.array([2.0, 0.5, -1.0])
    np.testing.assert_allclose(Wind(turn @ mean, 0.8).at(times), Wind(mean, 0.8).at(times) @ turn.T, atol=1e-12)
