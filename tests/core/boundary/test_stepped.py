# SPDX-License-Identifier: Apache-2.0
"""Hair on animation on twos moves as on the smooth motion, and holds with each pose; what stops still stops."""

from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core import rotation
from neuralocks_core.animation.cuts import find_cuts
from neuralocks_core.boundary.history import BoundarySampler
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.boundary.stepped import Stepped
from neuralocks_core.motion import Clip
from tests.core.rigs import HEAD, moved, person

FRAMES = np.arange(48)
STOP = np.full(12, 12)


def walk(times, speed=1.5):
    """A walk [m/s] with a nod, which comes back to its beginning after two seconds."""

    def place(t):
        return np.stack([0.1 * np.sin(np.pi * t), 0.02 * np.sin(4 * np.pi * t), speed * t], -1)

    def nod(t):
        return rotation.from_vector(np.outer(0.4 * np.sin(2 * np.pi * t), [1, 0.5, 0]))

    return moved(times, place, nod)


def shown(frames, rate=24, **options):
    """The walk at `rate` frames per second, each showing the pose of one of `frames`."""
    return Clip(np.arange(len(frames)) / rate, walk(np.arange(max(frames) + 1) / rate, **options).joints[frames])


def vectors(clip, frames, rate=24):
    return BoundarySampler(BoundarySpec(), person(), clip).vectors(np.asarray(frames) / rate)


@pytest.mark.parametrize("held", [2, 3, 4])
def test_hair_moves_as_through_the_distinct_poses_and_holds_with_them(held):
    first = FRAMES - FRAMES % held
    found = vectors(shown(first), FRAMES)
    np.testing.assert_allclose(found, vectors(walk(np.unique(first) / 24), first), atol=1e-5)
    error = np.abs(found - vectors(walk(FRAMES / 24), first))[12:]
    assert np.median(error.max(axis=1)) < 0.15, error.max(axis=1)


def test_far_from_the_origin_poses_are_told_apart_by_their_turns():
    """Where positions are rounded most, a nod of a few degrees is still not a held pose."""
    clip = shown(FRAMES - FRAMES % 2, speed=0.0)
    far = clip.joints.copy()
    far[:, :, 0, 3] += 1e4
    np.testing.assert_allclose(vectors(replace(clip, joints=far), FRAMES), vectors(clip, FRAMES), atol=1e-6)


def test_between_frames_the_motion_goes_from_pose_to_pose_as_they_are_drawn():
    """USD draws the chord from a held frame to the next pose; hair is that far on its way."""
    first = FRAMES - FRAMES % 2
    np.testing.assert_allclose(
        vectors(shown(first), [20.5, 21.5, 21.75]), vectors(walk(np.unique(first) / 24), [20, 21, 21.5]), atol=1e-2
    )


def test_a_body_on_twos_may_ride_on_what_moves_on_ones():
    """A vehicle, or a root with a key a frame, drives on and turns: the hair holds with the pose."""
    first = FRAMES - FRAMES % 2
    ride = np.tile(np.eye(4), (len(FRAMES), 1, 1))
    ride[:, :3, :3] = rotation.from_vector(np.outer(0.01 * FRAMES, [0, 1, 0]))
    ride[:, 2, 3] = 0.05 * FRAMES
    clip = shown(first, speed=0.0)
    ridden = replace(clip, joints=ride[:, None] @ clip.joints)
    assert not len(Stepped.of(replace(ridden, joints=ride[:, None] @ walk(FRAMES / 24).joints), [HEAD, 1]).held)
    history = vectors(ridden, FRAMES)[:, BoundarySpec().slices["history"]]
    np.testing.assert_array_equal(history[1::2], history[::2])
    assert np.abs(np.diff(history[::2], axis=0)).max(axis=1).min() > 1e-3


def test_poses_may_be_held_for_a_part_of_the_clip_and_for_one_frame_or_three():
    """On ones, then on twos and threes, with a pose that shows for one frame."""
    frames = [*range(12), 12, 12, 14, 14, 16, 16, 16, 19, 19, 21, 22, 22, 24, 24, *range(26, 40)]
    kept = Stepped.of(shown(frames), [HEAD]).clip.times * 24
    np.testing.assert_allclose(kept, [*range(12), 12, 14, 16, 19, 21, 22, 24, *range(26, 40)])


def test_a_stop_is_a_stop():
    """Half a second; the last frame before the walk continues belongs to the pose that is held for two."""
    frames = np.concatenate([FRAMES[:12] - FRAMES[:12] % 2, STOP, 14 + FRAMES[:24] - FRAMES[:24] % 2])
    stepped = Stepped.of(shown(frames), [HEAD])
    np.testing.assert_allclose(stepped.clip.times * 24, [*range(0, 12, 2), *range(12, 23), *range(24, 48, 2)])
    felt = np.abs(vectors(shown(frames), FRAMES)[:, BoundarySpec().slices["history"]])
    newest = felt[:, : BoundarySpec().per_bin].max(axis=1)
    assert newest[16:21].max() < 0.05 * np.median(newest[6:12])


@pytest.mark.parametrize(
    "frames",
    [
        FRAMES,
        [*range(12), *STOP, *range(13, 36)],
        [0, 1, 2, 3, 3, 4, 5, 6, 7, 8, 8, 9, 10, 11, 12, 13, 13, 14, 15, 16],  # some lost samples
        [0, 1, 2, 3, 3, 3, 3, 4, 5, 6, 7, 7, 7, 7, 8, 9, 10, 11, 11, 11, 11, 12],  # pauses of a robot
        FRAMES - FRAMES % 8,
        0 * FRAMES,
        [0, 0, 2],
    ],
    ids=["on ones", "a stop", "lost samples", "pauses", "blocked poses", "held", "few"],
)
def test_other_animation_is_as_it_is(frames):
    clip = shown(frames)
    assert Stepped.of(clip, [HEAD]).clip is clip


def test_slow_motion_is_no_steps():
    """A tenth of a millimetre a second, read with the rounding of float32 at a hundred metres."""
    joints = walk(FRAMES / 24).joints[:1].repeat(48, axis=0)
    joints[:, :, 0, 3] = np.float32(100 + 1e-4 * FRAMES[:, None] / 24)
    clip = Clip(FRAMES / 24, joints)
    assert (np.diff(joints[:, HEAD, 0, 3]) == 0).any() and Stepped.of(clip, [HEAD]).clip is clip


def test_what_hardly_moves_on_twos_is_no_steps():
    """A hundredth of a millimetre every second frame is slow motion, a tenth is a step."""
    clip = shown(0 * FRAMES)
    clip.joints[:, :, 0, 3] += 1e-5 * (FRAMES[:, None] // 2)
    assert Stepped.of(clip, [HEAD]).clip is clip
    clip.joints[:, :, 0, 3] *= 10
    assert len(Stepped.of(clip, [HEAD]).held)


def test_held_poses_far_from_the_origin_are_the_same_but_for_rounding():
    clip = shown(FRAMES - FRAMES % 2, speed=0.0)
    clip.joints[:, :, 0, 3] = np.float32(1e4)
    clip.joints[1::4, :, 0, 3] = np.nextafter(np.float32(1e4), np.float32(np.inf))
    np.testing.assert_array_equal(Stepped.of(clip, [HEAD]).clip.times, clip.times[::2])


def test_a_head_on_twos_above_a_chest_on_ones_is_not_stepped():
    """Hair reads both."""
    clip, ones = shown(FRAMES - FRAMES % 2), shown(FRAMES)
    assert len(Stepped.of(clip, [HEAD, 1]).held)
    clip.joints[:, 1] = ones.joints[:, 1]
    assert Stepped.of(clip, [HEAD, 1]).clip is clip


def test_a_loop_keeps_its_period():
    for last in (48, 49):  # the last frame begins a pose, or holds it
        frames = np.arange(last + 1)
        clip = replace(shown(frames - frames % 2, rate=last / 2, speed=0), loop=True)
        clip.joints[frames - frames % 2 == 48] = clip.joints[0]
        assert Stepped.of(clip, [HEAD]).clip.end == clip.end
        early, late = (vectors(clip, when, last / 2) for when in (frames, frames + last))
        np.testing.assert_allclose(early, late, atol=1e-4)


def test_a_cut_is_found_and_the_parts_are_each_on_twos():
    clip = shown(FRAMES - FRAMES % 2)
    clip.joints[20:, :, 0, 3] += 3
    np.testing.assert_allclose(find_cuts(clip, HEAD) * 24, [20])
    cut = replace(clip, cuts=find_cuts(clip, HEAD))
    alone = Clip(clip.times[20:], clip.joints[20:])
    np.testing.assert_allclose(vectors(cut, FRAMES[20:]), vectors(alone, FRAMES[20:]), atol=1e-6)
