# SPDX-License-Identifier: Apache-2.0
"""What hair is compared with: the same simulation, however the body came by its form."""

import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from scipy.interpolate import CubicSpline

from neuralocks_core import metrics, rotation
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.evaluation import comparison
from neuralocks_core.evaluation.comparison import simulated
from neuralocks_core.groom import Groom
from neuralocks_core.motion import Clip
from neuralocks_core.skinned_body import Body
from neuralocks_core.strands.strand_set import strand_set

from .. import rigs

pytest.importorskip("warp", reason="the extra 'train' is not installed")

HEAD = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
CENTRE = np.array([0.0, 1.68, 0.0])


def person(points, shapes):
    count = len(points)
    body = Body(points, HEAD.faces, np.full((count, 1), rigs.HEAD), np.ones((count, 1)), shapes)
    return Character(Skeleton(rigs.NAMES, rigs.PARENTS, rigs.bind()), body)


def lying_strands(character):
    """Eight strands that lie over the head, a little above its skin."""
    turn, down = np.linspace(0, 2 * np.pi, 8, endpoint=False)[:, None], np.linspace(0.2, 2.0, 12)
    way = np.stack([np.cos(turn) * np.sin(down), np.ones((8, 1)) * np.cos(down), np.sin(turn) * np.sin(down)], axis=-1)
    points = CENTRE + 0.112 * way
    groom = Groom("hair", points.reshape(-1, 3).astype(np.float32), np.full(8, 12))
    return strand_set(groom, rigs.POSITIONS[rigs.HEAD], CENTRE - rigs.POSITIONS[rigs.HEAD], character.facing)


def pushed(frames=10):
    """Times and world joint transforms of a character that accelerates to the side."""
    times = np.arange(frames) / 30
    joints = np.tile(rigs.bind(), (frames, 1, 1, 1))
    joints[:, :, 0, 3] += 0.3 * times[:, None] ** 2
    return times, joints


def test_a_body_shaped_by_a_blend_shape_is_simulated_as_one_modelled_so():
    swollen = HEAD.vertices * 1.2 + CENTRE
    shaped = person(HEAD.vertices + CENTRE, {"heavy": swollen - HEAD.vertices - CENTRE})
    modelled = person(swollen, {})
    answers, (times, joints) = [], pushed()
    for character, clip in ((shaped, Clip(times, joints, np.ones((10, 1)))), (modelled, Clip(times, joints))):
        # The strands lie within the part of the head that the shape adds.
        answers.append(simulated(character, lying_strands(character), clip, times))
    assert np.abs(answers[1]).max() > 1e-3
    np.testing.assert_allclose(answers[0], answers[1], atol=1e-5)


def test_hair_on_a_head_that_grows_and_shrinks_moves_as_on_one_that_keeps_its_size():
    """As for networks, which do not see scale."""
    character, (times, joints) = person(HEAD.vertices + CENTRE, {}), pushed()
    scaled = joints.copy()
    scaled[:, rigs.HEAD, :3, :3] *= np.linspace(0.8, 1.5, 10)[:, None, None]
    strands = lying_strands(character)
    kept, grown = (simulated(character, strands, Clip(times, each), times) for each in (joints, scaled))
    assert np.abs(kept).max() > 1e-3
    np.testing.assert_allclose(grown, kept, atol=1e-5)


def test_a_reference_is_as_smooth_at_every_rate_as_on_the_solvers_own_clock():
    """With linear interpolation of motion and answer, a perfect bake had a velocity error of a tenth."""
    character, strands = person(HEAD.vertices + CENTRE, {}), lying_strands(person(HEAD.vertices + CENTRE, {}))

    def swung(times):
        joints = np.tile(rigs.bind(), (len(times), 1, 1, 1))
        joints[:, :, 0, 3] += 0.1 * np.sin(8 * times)[:, None]
        joints[:, rigs.HEAD, :3, :3] = rotation.from_vector(np.outer(0.5 * np.sin(6 * times), [0, 1, 0]))
        return Clip(times, joints)

    clock = np.arange(61) / 30
    true = CubicSpline(clock, simulated(character, strands, swung(np.arange(481) / 240), clock))
    for rate in (24, 25, 60):
        times = np.arange(2 * rate + 1) / rate
        found = simulated(character, strands, swung(times), times)
        assert metrics.velocity_error(true(times), found, times) < 0.03
        assert metrics.motion_error(true(times), found, strands.length)["median"] < 0.01


def test_the_reference_of_animation_on_twos_is_that_of_the_smooth_motion_held_with_each_pose():
    character, strands = person(HEAD.vertices + CENTRE, {}), lying_strands(person(HEAD.vertices + CENTRE, {}))
    times = np.arange(24) / 24
    joints = np.tile(rigs.bind(), (24, 1, 1, 1))
    joints[:, :, 0, 3] += 1.5 * times[:, None]
    joints[:, rigs.HEAD, :3, :3] = rotation.from_vector(np.outer(0.5 * np.sin(6 * times), [0, 1, 0]))
    first = np.arange(24) - np.arange(24) % 2
    smooth = simulated(character, strands, Clip(times[::2], joints[::2]), times[::2])
    np.testing.assert_allclose(
        simulated(character, strands, Clip(times, joints[first]), times), smooth.repeat(2, axis=0), atol=1e-6
    )


def test_minutes_of_a_simulation_are_in_memory_twice_at_most(monkeypatch):
    """As the solver's rollout, and at the times wanted: of 2,000 strands, four minutes at 24 fps take 3 to 4 GB each."""
    times = np.arange(100) / 30
    character, clip = rigs.person(), Clip(times, np.tile(rigs.bind(), (100, 1, 1, 1)))
    strands = rigs.straight_hair(1000)

    def solved(rest, head, *_, **__):
        return SimpleNamespace(points=np.zeros((len(head), *rest.shape), np.float32))

    monkeypatch.setattr("neuralocks_core.reference.simulate", solved)
    monkeypatch.setattr("neuralocks_core.evaluation.comparison.lock_mates", lambda *_: None)
    tracemalloc.start()
    moved = simulated(character, strands, clip, times)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    np.testing.assert_array_equal(moved[-1], -strands.rest)
    assert most < 3 * moved.nbytes  # with the splines of a few strands


def test_a_part_of_the_times_wanted_is_the_same():
    character, (times, joints) = person(HEAD.vertices + CENTRE, {}), pushed(20)
    strands, wanted = lying_strands(character), np.arange(10) / 24
    whole, begun = (simulated(character, strands, Clip(times, joints), w) for w in (wanted, wanted[:6]))
    assert (whole[:6] == begun).all()


def test_after_a_cut_hair_begins_where_the_part_does_whichever_times_are_wanted():
    character, (times, joints) = person(HEAD.vertices + CENTRE, {}), pushed(30)
    joints[12:, :, 2, 3] += 3
    clip, strands = Clip(times, joints, cuts=times[[12]]), lying_strands(character)
    whole, late = (simulated(character, strands, clip, times[rows]) for rows in (range(26), [0, 24, 25]))
    np.testing.assert_allclose(late[1:], whole[24:], atol=1e-5)
    assert np.abs(whole[24:]).max() > 1e-3


def test_a_shot_that_ends_in_motion_is_felt_to_go_on():
    """Also before a cut: the solver's clock continues past the last sample."""
    character, times = person(HEAD.vertices + CENTRE, {}), np.arange(24) / 24
    joints = np.tile(rigs.bind(), (24, 1, 1, 1))
    joints[:, :, 0, 3] += times[:, None]
    clip = Clip(times, joints, cuts=times[[12]])
    found = simulated(character, lying_strands(character), clip, times)
    np.testing.assert_allclose(found, found[:1].repeat(24, axis=0), atol=1e-5)
    between = simulated(character, lying_strands(character), clip, np.arange(72) / 72)
    np.testing.assert_allclose(between[::3], found, atol=1e-5)
    handles = simulated(character, lying_strands(character), Clip(times, joints), np.arange(36) / 24)
    np.testing.assert_allclose(handles[:24], found, atol=1e-5)
    assert np.abs(handles[24:] - handles[23]).max() > 1e-3, "and afterwards it stands"


def test_a_volume_term_is_integrated_in_finer_steps(monkeypatch):
    """Its force lags behind within a step, so that steps as long as for hair without it leave an error that nothing shows."""
    rng, character = np.random.default_rng(0), person(HEAD.vertices + CENTRE, {})
    roots = CENTRE + [0.11, 0, 0] + rng.uniform(-0.015, 0.015, (16, 1, 3)) * [1, 0, 1]
    points = roots + np.linspace(0, -0.2, 24)[:, None] * [0, 1.0, 0]
    groom = Groom("hair", points.reshape(-1, 3).astype(np.float32), np.full(16, 24))
    origin = rigs.POSITIONS[rigs.HEAD]
    strands = strand_set(groom, origin, CENTRE - origin, character.facing)
    times, joints = pushed(13)
    joints[:, :, 0, 3] = joints[0, :, 0, 3] + 0.15 * np.sin(9 * times)[:, None]
    answers = {}
    for substeps in (1, comparison.CROWDED_STEPS, 8):
        monkeypatch.setattr(comparison, "CROWDED_STEPS", substeps)
        answers[substeps] = simulated(character, strands, Clip(times, joints), times, volume=3.0)
    coarse, ours, fine = answers.values()
    assert np.sqrt(np.square(ours - fine).mean()) < 0.4 * np.sqrt(np.square(coarse - fine).mean()) > 1e-4


def test_by_xpbd_hair_of_a_tilted_head_starts_where_it_hangs():
    """XPBD itself finds no equilibrium: hair that starts as it rests on an upright head would fall."""
    times, tilt = np.arange(20) / 30, np.eye(4)
    tilt[:2, :2] = [[0.5, -(0.75**0.5)], [0.75**0.5, 0.5]]
    character, strands = rigs.person(), rigs.straight_hair(4)
    moved = simulated(character, strands, Clip(times, np.tile(tilt @ rigs.bind(), (20, 1, 1, 1))), times, xpbd=50)
    assert np.abs(moved[0]).max() > 0.1 > 10 * np.abs(moved - moved[0]).max()  # it stretches a little
