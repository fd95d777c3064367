# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion that the add-on samples, without Blender: what is stored of it, found by frame, and read of it."""

from dataclasses import replace

import numpy as np
import pytest

from dcc_addon.services.hair.history import SampledBoundary
from dcc_addon.services.rigs import following, rig
from dcc_addon.services.rigs.motion import Motion, frame_numbers, similar
from neuralocks_core.boundary.history import BoundarySampler
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import loop_turns
from neuralocks_core.rotation import from_vector
from tests.addon.few_bones import BONES, PARENTS, PLACES, rest
from tests.core.rigs import moved, person


def _motion(rng, scale=1.0, stretch=0.0):
    """World transforms (T, J, 4, 4) of a chain that turns randomly, and the bind pose."""
    bind = scale * rest()
    bind[:, 3, 3] = 1
    turns = from_vector(rng.normal(size=(9, 6, 3)) * 0.4)
    world = np.zeros((9, 6, 4, 4))
    for joint, parent in enumerate(PARENTS):
        local = np.tile(np.eye(4), (9, 1, 1))
        local[:, :3, :3] = turns[:, joint] * (scale if parent < 0 else 1.0)
        local[:, :3, 3] = scale * PLACES[0] if parent < 0 else PLACES[joint] - PLACES[parent]
        world[:, joint] = local if parent < 0 else world[:, parent] @ local
    world[..., 1, :3] *= 1 + stretch
    return bind, world


@pytest.mark.parametrize("scale", [1.0, 0.01, 37.0])
def test_stored_channels_give_the_sampled_poses_back(scale):
    """Also for an armature object of any scale, although scales of a SkelAnimation have half precision."""
    bind, world = _motion(np.random.default_rng(0), scale)
    motion = Motion.from_world(np.arange(9), 24, 1.0, PARENTS, bind, world, np.zeros((9, 0)))
    apart = motion.world() - world @ np.diag([1 / scale, 1 / scale, 1 / scale, 1])
    assert np.abs(apart[..., :3, :3]).max() < 1e-6
    assert np.abs(apart[..., :3, 3]).max() < 1e-6 * scale
    assert set(np.unique(motion.scale)) == {1.0}


def test_rounding_does_not_add_up_along_a_chain():
    """Each joint is stored relative to its parent as stored: a long spine ends where Blender has it."""
    count, rng = 200, np.random.default_rng(2)
    local = np.tile(np.eye(4), (3, count, 1, 1))
    local[..., :3, :3] = from_vector(0.3 * rng.normal(size=(3, count, 3)))
    local[:, 1:, 1, 3] = 0.37
    world, parents = local.copy(), np.arange(count) - 1
    for joint in range(1, count):
        world[:, joint] = world[:, joint - 1] @ local[:, joint]
    motion = Motion.from_world(np.arange(3), 24, 1.0, parents, world[0], world, np.zeros((3, 0)))
    apart = np.abs(motion.world() - world)[..., :3, :].max(axis=(0, 2, 3))
    assert apart[150:].max() < 3 * apart[:50].max()


def test_stretched_bones_keep_place_and_rotation():
    """A stretched bone has no single scale; what hair reads of it stays."""
    bind, world = _motion(np.random.default_rng(1))
    stretched = world @ np.diag([1.0, 1.7, 1.0, 1.0])
    result = similar(stretched)
    np.testing.assert_allclose(result[..., :3, 3], world[..., :3, 3])
    np.testing.assert_allclose(result[..., :3, :3] / 1.7 ** (1 / 3), world[..., :3, :3], atol=1e-9)


def _stretched(rng, apart=()):
    """World transforms (9, 6, 4, 4) of a chain whose joints turn and scale unevenly at random; those `apart` inherit no scale."""
    turns, world = from_vector(rng.normal(size=(9, 6, 3)) * 0.4), np.zeros((9, 6, 4, 4))
    for joint, parent in enumerate(PARENTS):
        local = np.tile(np.eye(4), (9, 1, 1))
        local[:, :3, :3] = turns[:, joint] * rng.uniform(0.7, 1.4, (9, 1, 3))
        local[:, :3, 3] = PLACES[0] if parent < 0 else PLACES[joint] - PLACES[parent]
        world[:, joint] = local if parent < 0 else world[:, parent] @ local
        if joint in apart:
            world[:, joint, :3, :3] = turns[:, joint] @ from_vector([0.5, 0.2, 0.1])
    return world


def test_channels_carry_what_is_stretched_along_a_chain():
    world = _stretched(np.random.default_rng(5))
    motion = Motion.from_world(np.arange(9), 24, 1.0, PARENTS, rest(), world, np.zeros((9, 0)), head=3)
    assert np.abs(motion.world() - world).max() < 2e-3
    parts = [
        Motion.from_world(np.arange(9)[r], 24, 1.0, PARENTS, rest(), world[r], np.zeros((9, 0))[r], head=3)
        for r in (slice(2), slice(2, 9))
    ]
    assert np.array_equal(Motion.joined(parts, {}).world(), motion.world())


def test_a_head_that_inherits_no_stretch_is_exact():
    """Joints below it have one scale, because a chain cannot carry both; all stay in place."""
    world = _stretched(np.random.default_rng(6), apart=(3,))
    motion = Motion.from_world(np.arange(9), 24, 1.0, PARENTS, rest(), world, np.zeros((9, 0)), head=3)
    made = motion.world()
    assert np.abs(made[:, 3] - world[:, 3]).max() < 1e-3
    assert np.abs(made[..., :3, 3] - world[..., :3, 3]).max() < 1e-3
    assert np.ptp(np.linalg.norm(made[:, :3, :3, :3], axis=-2), axis=-1).max() < 1e-3


def test_an_unevenly_scaled_object_is_part_of_its_bind_pose():
    """At rest its joints are where they were bound, without scale."""
    place = np.diag([1.1, 1.0, 0.9, 1.0])
    motion = Motion.from_world([0], 24, 1.0, PARENTS, place @ rest(), (place @ rest())[None], np.zeros((1, 0)))
    arrays = rig.RigArrays("Rig", BONES, PARENTS, rest())
    assert np.abs(motion.world()[0] - rig.bind_world(arrays, place)).max() < 1e-6


def test_mirrored_armature_is_refused_in_plain_words():
    with pytest.raises(NeuralocksError, match="Rig: it is mirrored .*apply its scale"):
        similar(np.diag([-1.0, 1, 1, 1])[None], "Rig")


def test_the_gap_of_a_loop_is_the_one_that_a_bake_tells():
    """Six joints of a spine that are each off by 1.8 degrees turn the last one by 10.8."""
    count, parents = 6, np.arange(6) - 1
    world = np.tile(np.eye(4), (3, count, 1, 1))
    for row, turn in enumerate(np.radians([0.0, 0.9, 1.8])):
        for joint in range(count):
            world[row, joint, :3, :3] = from_vector(np.array([0.0, 0.0, (joint + 1) * turn]))
    motion = Motion.from_world(np.arange(3), 24, 1.0, parents, world[0], world, np.zeros((3, 0)))
    assert motion.gap == pytest.approx(10.8, abs=1e-3)
    assert motion.gap == pytest.approx(loop_turns(world[[0, -1]]).max(), abs=1e-3)
    assert replace(motion, rotation=motion.rotation[[0, 1, 0]]).gap == 0


def test_samples_are_found_by_frame():
    bind, world = _motion(np.random.default_rng(2))
    motion = Motion.from_world(np.arange(9) / 2 + 3, 25, 1.0, PARENTS, bind, world, np.zeros((9, 0)))
    assert [motion.row(f) for f in (3, 3.5, 7, 2, 3.3, 7.5)] == [0, 1, 8, None, None, None]
    assert motion.times[-1] == 7 / 25


def test_a_clips_own_samples_are_what_the_sampler_gives():
    """Stored or not, in blocks or alone: the same bits, also after a change of look, between samples, and for another pose."""
    rng, times = np.random.default_rng(3), np.arange(21) / 24
    clip = moved(times, lambda t: np.stack([np.sin(5 * t), 0 * t, t], -1))
    sampler = BoundarySampler(BoundarySpec(), person(), clip)
    kept = SampledBoundary(sampler)
    for material, strength in (((0.0,) * 4, 1.0), ((0.3, 0, 0, 0.1), 0.7)):
        for row in rng.permutation(21):
            found = kept.vector(times[row], material, strength, clip.joints[row])
            assert np.array_equal(found, sampler.vectors([times[row]], material, strength, clip.joints[row][None])[0])
    other = clip.joints[4].copy()
    other[:, 0, 3] += 0.1
    other[:, :3, :3] = from_vector([0, 0.4, 0]) @ other[:, :3, :3]
    for t, joints in ((times[4], other), (times[4] + 0.01, clip.joints[4]), (2.0, clip.joints[20])):
        found = kept.vector(t, material, 0.7, joints)
        assert np.array_equal(found, sampler.vectors([t], material, 0.7, joints[None])[0])


@pytest.mark.parametrize("size", [1.0, 0.6, 1.7])
def test_a_character_is_measured_at_the_size_shown(size):
    """Bones scale the head: it stands as it is drawn, and the bind pose is as large as its hair."""
    bind, world = _motion(np.random.default_rng(4))
    world[:, 3, :3, :3] *= size
    motion = Motion.from_world(np.arange(9), 24, 1.0, PARENTS, bind, world, np.zeros((9, 0)))
    shown = rig.size_shown(rig.RigArrays("Rig", BONES, PARENTS, rest()), np.eye(4), motion.world()[:, 3])
    assert shown == pytest.approx(size, rel=1e-3)


def test_a_head_that_no_bone_scales_is_exactly_as_large_as_in_the_bind_pose():
    """However the armature stands, as in the bake: with another rounding in each sampling, the character would be another one, and its
    hair prepared again.
    """
    rng, armature = np.random.default_rng(0), rig.RigArrays("Rig", BONES, PARENTS, rest())
    _, world = _motion(rng)
    for turn in rng.normal(size=(20, 3)):
        place = np.eye(4)
        place[:3, :3] = 1.3 * from_vector(turn)
        bind, posed = rig.bind_world(armature, place), place @ world @ np.diag([1 / 1.3, 1 / 1.3, 1 / 1.3, 1])
        motion = Motion.from_world(np.arange(9), 24, 1.0, PARENTS, bind, posed, np.zeros((9, 0)))
        assert rig.size_shown(armature, place, motion.world()[:, 3]) == 1.0


def test_what_goes_with_the_head_alone_is_on_it():
    """A hat a metre in front of a head that turns; if everything stands still, or moves with the whole figure, nothing is known."""
    still = np.tile(np.eye(4), (5, 1, 1))
    turning = still.copy()
    turning[:, :3, :3] = from_vector(np.outer(np.linspace(0, 1, 5), [0, 0, 1]))
    hat, bind = np.eye(4), np.eye(4)
    hat[:3, 3], bind[:3, 3] = (0, -1, 0), (0, 0, 1.6)
    np.testing.assert_allclose(following.on_joint(turning @ hat, still, turning, bind), bind @ hat, atol=1e-12)
    assert following.on_joint(still @ hat, still, still, bind) is None
    assert following.on_joint(turning @ hat, turning, turning, bind) is None
    assert following.on_joint(still @ hat, still, turning, bind) is None


@pytest.mark.parametrize("away", [0.0, 1e4])
def test_a_beard_goes_with_the_jaw_where_the_head_does_not_take_it_along(away):
    """It rides on the first joint below the head that it does not move relative to; a joint hidden by zero scale carries nothing.
    This also holds far from the origin, where Blender rounds places.
    """
    heads = np.tile(np.eye(4), (5, 1, 1))
    heads[:, 0, 3] = away
    heads[:, :3, :3] = from_vector(np.outer(np.linspace(0, 1, 5), [0, 0, 1]))
    jaw, beard = heads.copy(), np.eye(4)
    jaw[:, :3, :3] = heads[:, :3, :3] @ from_vector(np.outer(np.linspace(0, 0.5, 5), [1, 0, 0]))
    beard[:3, 3] = (0, -0.1, 0)
    hidden = jaw.copy()
    hidden[2, :3, :3] = 0
    joints = {3: heads @ beard, 4: hidden, 5: jaw, 6: jaw @ beard}

    def carrier(places):
        return following.carrier_below(places.astype(np.float32), heads, [3, 4, 5, 6], joints.__getitem__)

    assert carrier(jaw @ beard) == 5
    assert carrier(heads @ beard) is None
    assert carrier(np.tile(beard, (5, 1, 1))) is None


def test_a_motion_in_parts_is_the_whole():
    bind, world = _motion(np.random.default_rng(4))
    frames, shape, places = np.arange(9), np.arange(18.0).reshape(9, 2), {"": world[:, 0]}

    def of(rows):
        return Motion.from_world(frames[rows], 24, 1.0, PARENTS, bind, world[rows], shape[rows])

    whole, joined = of(slice(9)), Motion.joined([of(slice(4)), of(slice(4, 9))], places)
    for name in ("frames", "translation", "rotation", "scale", "shape"):
        assert np.array_equal(getattr(whole, name), getattr(joined, name)), name
    assert joined.places == places


def test_a_sample_is_found_by_the_frame_that_blender_shows():
    """Blender's fractions of frames have single precision; between the samples there is none."""
    bind, world = _motion(np.random.default_rng(4))
    frames = frame_numbers(-1, 2, 3)[:9]
    motion = Motion.from_world(frames, 24, 1.0, PARENTS, bind, world, np.zeros((9, 0)))
    for row, frame in enumerate(frames):
        whole = int(np.floor(frame))
        for near in (whole + float(np.float32(frame - whole)), frame - 1e-7, frame + 1e-7):
            assert motion.row(near) == row
    assert [motion.row(frame) for frame in (-1.2, -0.5, 1.5, 2.0)] == [None] * 4


def test_frame_numbers():
    np.testing.assert_allclose(frame_numbers(1, 3, 2), [1, 1.5, 2, 2.5, 3])
    assert list(frame_numbers(4, 4, 3)) == [4]
    with pytest.raises(NeuralocksError, match="ends at 1"):
        frame_numbers(2, 1, 1)


def test_a_path_strays_from_what_it_follows_most_closely():
    """What a scale of zero hides in the first frame is not followed."""
    times = np.linspace(0, 1, 9)
    walking, turning = np.tile(np.eye(4), (2, 9, 1, 1))
    walking[:, 0, 3] = times
    turning[:, :3, :3] = from_vector(times[:, None] * [0, 0, 1.0])
    path = np.array([0.5, 0, 0]) + times[:, None] * [1.0, 0.02, 0]
    assert following.strays(path, [turning, walking]) == pytest.approx(0.02)
    gone = walking.copy()
    gone[0, :3, :3] = 0
    assert following.strays(path, [gone, turning]) == following.strays(path, [turning]) > 0.5
    assert following.strays(path, [gone]) == 0


@pytest.mark.parametrize(("far", "least"), [(0.0, 1e-4), (50.0, 5e-3), (200.0, 2e-2), (2e5, 0.4)])
def test_the_farther_off_a_thing_is_the_less_exactly_it_follows(far, least):
    """Blender's places are in single precision: a character kilometres off seems to tremble on its own bones."""
    times, still = np.linspace(0, 1, 9), np.tile(np.eye(4), (9, 1, 1))
    walking = still.copy()
    walking[:, 0, 3] = far + times
    for share, follows in ((0.8, True), (1.4, False)):
        places = walking.copy()
        places[4, 1, 3] += share * least
        assert (following.on_joint(places, still, walking, np.eye(4)) is not None) == follows, share
