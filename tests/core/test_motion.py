# SPDX-License-Identifier: Apache-2.0
"""Clips hold samples exactly, blend between them, and refuse what is broken."""

from unittest.mock import Mock

import numpy as np
import pytest

from neuralocks_core import motion, rotation
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import Clip
from tests.core.rigs import HEAD, bind, moved


def test_samples_come_back_bit_for_bit_and_halfway_is_halfway():
    def turn(t):
        return rotation.from_vector(np.stack([0 * t, t, 0 * t], axis=-1))

    clip = moved([0.0, 0.1, 0.3], lambda t: np.stack([t, 0 * t, 0 * t], axis=-1), turn)
    assert np.array_equal(clip.at(clip.times), clip.joints)
    half = clip.at([0.2])[0, HEAD]
    assert half[0, 3] == pytest.approx(0.2)
    assert rotation.to_vector(half[:3, :3])[1] == pytest.approx(0.2)
    assert np.array_equal(clip.at([-5.0])[0], clip.joints[0])
    assert np.array_equal(clip.at([9.0])[0], clip.joints[-1])


def test_samples_are_not_blended(monkeypatch):
    """Reading a crowd asks each clip for its ends, once for each other character."""
    blends = Mock(wraps=motion._blend)
    monkeypatch.setattr(motion, "_blend", blends)
    clip = moved([0.0, 0.1, 0.3], lambda t: np.stack([t, 0 * t, 0 * t], axis=-1))
    assert np.array_equal(clip.at([0.0, 0.3, 9.0]), clip.joints[[0, 2, 2]])
    assert not blends.called
    clip.at([0.0, 0.2])
    assert blends.called


def test_a_loop_goes_on():
    clip = moved([0.0, 1.0, 2.0], lambda t: np.stack([np.sin(np.pi * t), 0 * t, 0 * t], axis=-1), loop=True)
    assert np.allclose(clip.at([0.4]), clip.at([4.4]))
    assert np.allclose(clip.at([0.4]), clip.at([-1.6]))
    for ask in (clip.at, clip.shape_at):
        with pytest.raises(NeuralocksError, match="times: hold infinity, where a loop has no pose; give seconds"):
            ask([0.4, np.inf])


def test_a_loop_that_walks_on_ends_with_its_last_sample():
    clip = moved([0.0, 1.0, 2.0], lambda t: np.stack([t, 0 * t, 0 * t], axis=-1), loop=True)
    assert np.array_equal(clip.at([clip.end])[0], clip.joints[-1])


def test_a_loop_tells_how_far_its_ends_are_turned_apart_but_not_of_joints_that_are_hidden_at_one():
    ends = np.tile(np.diag([2.0, -1.0, 3.0, 1.0]), (2, 4, 1, 1))
    ends[1, 1:, :3, :3] = rotation.from_vector([0.0, 0.5, 0.0]) @ ends[1, 1:, :3, :3]
    ends[0, 2, :3, :3] = 0
    ends[1, 3, :3, :3] = 0
    np.testing.assert_allclose(motion.loop_turns(ends), [0, np.degrees(0.5), 0, 0], atol=1e-5)


def test_a_joint_that_grows_is_half_grown_halfway():
    clip = moved([0.0, 1.0], head_turn=lambda t: rotation.from_vector(np.outer(t, [0, 1.0, 0])))
    grown = clip.joints.copy()
    grown[1, HEAD, :3, :3] *= 2
    half = Clip(clip.times, grown).at([0.5])[0, HEAD, :3, :3]
    np.testing.assert_allclose(half, 1.5 * rotation.from_vector([0, 0.5, 0]), atol=1e-12)


def test_mirrored_and_flat_joints_blend_too():
    clip = moved([0.0, 1.0], head_turn=lambda t: rotation.from_vector(np.stack([0 * t, t, 0 * t], axis=-1)))
    odd = clip.joints.copy()
    odd[:, 4, :3, :3] = odd[:, HEAD, :3, :3] * [-1, 2, 1]
    odd[:, 5, :3, :3] = 0
    plain, found = clip.at([0.3])[0], Clip(clip.times, odd).at([0.3])[0]
    np.testing.assert_allclose(found[4, :3, :3], plain[HEAD, :3, :3] * [-1, 2, 1], atol=1e-12)
    assert not found[5, :3, :3].any()
    np.testing.assert_allclose(found[:4], plain[:4], atol=1e-12)


@pytest.mark.parametrize(
    ("times", "change", "fact"),
    [([], None, "no samples"), ([0.0, 0.0], None, "ascend"), ([0.0, 1.0], np.nan, "NaN")],
)
def test_bad_clips_are_refused(times, change, fact):
    joints = np.tile(bind(), (len(times), 1, 1, 1))
    if change is not None:
        joints[1, 0, 0, 0] = change
    with pytest.raises(NeuralocksError, match=fact):
        Clip(times, joints)


@pytest.mark.parametrize("cuts", [0.5, [[0.5]], [np.nan], [0.5, np.inf]])
def test_cuts_that_are_no_times_are_refused(cuts):
    with pytest.raises(NeuralocksError, match="animation: cuts at .*; give finite times"):
        Clip([0.0, 1.0], np.tile(bind(), (2, 1, 1, 1)), cuts=cuts)


@pytest.mark.parametrize("ask", (Clip.at, Clip.shape_at))
@pytest.mark.parametrize(
    ("times", "fact"),
    [
        ([0.5, np.nan], "hold NaN"),
        ("x", "is not an array of numbers; give .n,. seconds"),
        ([[0.5]], "are of shape .1, 1."),
    ],
)
def test_a_time_that_is_none_is_refused(ask, times, fact):
    with pytest.raises(NeuralocksError, match=f"times: {fact}"):
        ask(moved([0.0, 1.0]), times)


@pytest.mark.parametrize("change", [{"times": "ab"}, {"joints": None}, {"shape": [[1], [2, 3]]}, {"cuts": None}])
def test_what_is_no_array_of_numbers_is_named(change):
    given = {"times": [0.0, 1.0], "joints": np.tile(bind(), (2, 1, 1, 1))} | change
    with pytest.raises(NeuralocksError, match=f"animation's {next(iter(change))}: is not an array of numbers; give"):
        Clip(**given)


@pytest.mark.parametrize("loop", ["no", None, 1])
def test_a_loop_is_one_or_not(loop):
    assert not Clip([0.0, 1.0], np.tile(bind(), (2, 1, 1, 1)), loop=np.False_).period
    with pytest.raises(NeuralocksError, match=f"animation's loop '?{loop}'?: must be True or False"):
        Clip([0.0, 1.0], np.tile(bind(), (2, 1, 1, 1)), loop=loop)


def test_times_are_one_row():
    with pytest.raises(NeuralocksError, match=r"animation: its times are of shape \(\); give \(T,\) seconds"):
        Clip(0.0, bind()[None])
