# SPDX-License-Identifier: Apache-2.0
"""Every metric on motion whose answer is known."""

import numpy as np
import pytest

from neuralocks_core import metrics
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.evaluation.report import LABELS

TIMES = np.arange(0, 4, 1 / 50)
LENGTH = np.array([0.3, 0.5])


def swinging(amplitude=0.05, frequency=1.0, decay=0.0, phase=0.0):
    """Two straight strands along -Y whose vertices swing along X in proportion to their position."""
    place = np.linspace(0, 1, 24)
    rest = np.zeros((2, 24, 3))
    rest[:, :, 1] = -place * LENGTH[:, None]
    swing = amplitude * np.exp(-decay * TIMES) * np.sin(2 * np.pi * frequency * TIMES + phase)
    points = np.repeat(rest[None], len(TIMES), axis=0)
    points[..., 0] += swing[:, None, None] * place
    return points, rest


def test_reference_scores_itself_perfectly_and_rigid_hair_scores_one():
    reference, rest = swinging()
    rigid = np.broadcast_to(rest, reference.shape)
    assert metrics.velocity_error(reference, reference, TIMES) == 0
    assert metrics.motion_ratio(reference, reference, TIMES) == 1
    assert set(metrics.motion_error(reference, reference, LENGTH).values()) == {0}
    # At the ends of a swing, eight times, the reference itself stands still.
    assert len(TIMES) - 9 <= metrics.dynamic_frames(reference, reference, TIMES) <= len(TIMES) - 1
    assert metrics.velocity_error(rigid, reference, TIMES) == pytest.approx(1)
    assert metrics.motion_ratio(rigid, reference, TIMES) == 0
    assert metrics.motion_error(rigid, reference, LENGTH) == pytest.approx({"median": 1, "p95": 1, "rms": 1})
    assert metrics.dynamic_frames(rigid, reference, TIMES) == 0


def test_half_the_amplitude_is_half_the_motion():
    reference, _ = swinging()
    half, _ = swinging(amplitude=0.025)
    assert metrics.motion_ratio(half, reference, TIMES) == pytest.approx(0.5)
    assert metrics.motion_error(half, reference, LENGTH)["median"] == pytest.approx(0.5)
    assert metrics.velocity_error(half, reference, TIMES) == pytest.approx(0.5)


def test_the_jump_of_hair_that_starts_anew_is_no_motion():
    """The same swing twice, with a cut in between, where one of the two hairs jumps by three metres."""
    (reference, _), (half, _) = swinging(), swinging(amplitude=0.025)
    twice = np.concatenate([TIMES, TIMES + 4])
    jumping, steady = np.concatenate([half, half + 3]), np.concatenate([reference, reference])
    assert len(metrics.speed(jumping, twice, [4.0])) == len(twice) - 2
    for cut in (4.0, 3.99, TIMES[-1] + 1e-3):
        assert metrics.motion_ratio(jumping, steady, twice, [cut]) == pytest.approx(0.5)
        assert metrics.velocity_error(jumping, steady, twice, [cut]) == pytest.approx(0.5)
    alone = metrics.dynamic_frames(reference, reference, TIMES)
    assert metrics.dynamic_frames(steady, steady, twice, [4.0]) == 2 * alone
    assert metrics.motion_ratio(jumping, steady, twice) > 0.6
    assert np.isnan(metrics.motion_ratio(jumping[-2:], steady[-2:], twice[-2:], [twice[-1]]))


def test_a_constant_droop_is_no_error_of_motion_but_one_of_position():
    reference, _ = swinging()
    lower = reference - [0, 0.02, 0]
    assert metrics.motion_error(lower, reference, LENGTH)["rms"] == pytest.approx(0, abs=1e-12)
    assert metrics.position_error(lower, reference, LENGTH) == pytest.approx(100 * (0.02 / LENGTH).mean())


def test_opposite_motion_is_twice_as_wrong_as_rigid():
    reference, _ = swinging()
    against, _ = swinging(phase=np.pi)
    assert metrics.motion_error(against, reference, LENGTH)["median"] == pytest.approx(2)


def test_a_strand_that_rests_elsewhere_moves_the_rms_more_than_the_median():
    reference, rest = swinging()
    reference = np.concatenate([reference] * 5, axis=1)
    points = reference * 0.9 + 0.1 * np.concatenate([rest] * 5)
    points[:, 0] = 0
    error = metrics.motion_error(points, reference, np.tile(LENGTH, 5))
    assert error["median"] == pytest.approx(0.1) and error["rms"] > 2 * error["median"]
    assert error["p95"] > 5 * error["median"]


def test_of_a_reference_without_motion_nothing_is_relative():
    """Fur moves by less than single precision resolves: without this, its card says 1.5 times the error, 75 % of the motion."""
    reference, rest = swinging(amplitude=1e-6)
    noise = rest + np.random.default_rng(0).normal(size=reference.shape) * 1e-6
    assert np.isnan(metrics.velocity_error(noise, reference, TIMES))
    assert np.isnan(metrics.motion_ratio(noise, reference, TIMES))
    assert np.isnan(metrics.motion_error(noise, reference, LENGTH)["p95"])
    assert metrics.dynamic_frames(noise, reference, TIMES) == 0


def test_dynamic_frames_counts_the_longest_run():
    reference, rest = swinging()
    points = reference.copy()
    points[100:120] = points[100]
    run = metrics.dynamic_frames(points, reference, TIMES)
    assert 95 <= run <= 105
    stopped = reference.copy()
    stopped[60:] = stopped[60]
    assert 55 <= metrics.dynamic_frames(stopped, stopped, TIMES) <= 60


@pytest.mark.parametrize(("share", "counted"), [(0.3, False), (0.4, True)])
def test_a_frame_is_dynamic_from_35_percent_of_the_references_speed_on(share, counted):
    reference, rest = swinging()
    run = metrics.dynamic_frames(rest + share * (reference - rest), reference, TIMES)
    assert run == (metrics.dynamic_frames(reference, reference, TIMES) if counted else 0)


def test_strands_that_move_less_than_half_a_percent_of_their_length_have_no_motion_to_compare():
    reference, rest = swinging(amplitude=1.0)
    rms = np.sqrt(np.square(reference - rest).sum(axis=-1).mean(axis=(0, 2)))
    slight = rest + (reference - rest) * (np.array([0.004, 0.006]) * LENGTH / rms)[:, None, None]
    _, moving = metrics.swings(rest + 0 * slight, slight, LENGTH)
    assert moving == pytest.approx([0.006 * LENGTH[1]])


def test_dynamic_frames_are_samples_and_the_card_says_so():
    """A shot's frame may have several samples."""
    reference, _ = swinging()
    assert metrics.dynamic_frames(reference[::2], reference[::2], TIMES[::2]) <= len(TIMES) // 2
    assert "samples" in LABELS["dynamic_frames"][0]


def test_settling_of_a_decaying_swing():
    """A swing that decays as exp(-3 t) is at 10 % after ln(10) / 3 s, to within half a period."""
    points, _ = swinging(amplitude=0.2, frequency=4, decay=3)
    assert metrics.settling_time(points, TIMES, stop=0.0) == pytest.approx(np.log(10) / 3, abs=0.125)
    still = np.broadcast_to(points[:1], points.shape)
    assert metrics.settling_time(still, TIMES, stop=1.0) == 0
    assert metrics.jitter(still) == 0


def test_what_stops_at_once_has_settled_at_its_last_moving_sample():
    points = np.zeros((len(TIMES), 1, 24, 3))
    points[:, 0, :, 0] = np.minimum(TIMES, 0.5)[:, None]
    assert metrics.settling_time(points, TIMES, stop=0.0) == 0.5


def test_what_creeps_on_slower_than_still_has_settled():
    """Even if that is more than a tenth of a slow motion; the card says so."""
    assert f"or {100 * metrics.STILL:g} cm/s" in LABELS["settling_s"][2]
    points = np.zeros((len(TIMES), 1, 24, 3))
    points[:, 0, :, 0] = np.where(TIMES < 0.5, 0.05 * TIMES, 0.025 + 0.008 * (TIMES - 0.5))[:, None]
    assert metrics.settling_time(points, TIMES, stop=0.0) == 0.5


@pytest.mark.parametrize("rate", [12, 24, 384, 1536])
def test_a_held_pose_is_the_same_however_often_it_is_sampled(rate):
    """Breathing moves a head by some mm/s: 64 samples per frame of it are not a stop, and rounding of a pose is not motion."""
    times = np.arange(0, 2, 1 / rate)
    joints = np.tile(np.eye(4), (len(times), 2, 1, 1))
    joints[:, 1, 1, 3] = 5.0 + 0.003 * times * (times < 1)
    joints = joints + np.random.default_rng(0).uniform(-2e-7, 2e-7, joints.shape)
    assert (metrics.held(joints, times)[1:] == (times[:-1] >= 1 - 1e-9)).mean() > 1 - 2 / len(times)


def test_echo_of_a_decaying_swing():
    """Speed falls as exp(-3 t), a swing's mean speed is 2 / pi of its peak; still hair has no echo."""
    points, _ = swinging(amplitude=0.2, frequency=4, decay=3)
    mean = (np.exp(-1.5) - np.exp(-6)) / (3 * 1.5)
    assert metrics.echo(points, points, TIMES, stop=0.0) == pytest.approx(100 * mean * 2 / np.pi, rel=0.15)
    still = np.broadcast_to(points[:1], points.shape)
    assert metrics.echo(still, points, TIMES, stop=0.0) == 0
    assert np.isnan(metrics.echo(points, still, TIMES, stop=0.0))
    against, _ = swinging(amplitude=0.2, frequency=4, decay=3, phase=np.pi)
    own, wrong = (metrics.echo(p, points, TIMES, stop=0.0) for p in (against, against - points))
    assert own == pytest.approx(metrics.echo(points, points, TIMES, stop=0.0)) and wrong == pytest.approx(2 * own)


def test_lengths_of_ragged_strands_and_stretch():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 2, 0], [5, 5, 5], [0, 0, 0], [0, 0, 6.0]])
    counts = np.array([3, 1, 2])
    lengths = metrics.strand_lengths(points, counts)
    np.testing.assert_allclose(lengths, [3, 0, 6])
    result = metrics.stretch(np.array([[3.3, 0, 6.0]]), lengths)
    assert result["stretch_cm"] == pytest.approx(15)
    assert result["stretch_percent"] == pytest.approx(5)
    assert result["stretch_percent_max"] == pytest.approx(10)


def test_penetration_counts_only_what_is_deeper_than_at_rest():
    rest = np.array([0.01, 0.01, -0.002, -0.002, 0.01])
    now = np.array([[0.01, -0.001, -0.002, -0.007, -0.004]])
    result = metrics.penetration(now, rest)
    assert result["penetration_percent"] == pytest.approx(60)
    assert result["penetration_3mm_percent"] == pytest.approx(40)
    assert result["penetration_worst_mm"] == pytest.approx(5)
    assert result["inside_at_rest_percent"] == pytest.approx(40)
    rounded = metrics.penetration(np.array([[-1e-6, -0.002001]]), np.array([0.0, -0.002]))
    assert rounded["penetration_percent"] == 0 < rounded["penetration_worst_mm"]


def test_what_is_unknown_is_not_fine():
    """NaN in one strand or one frame."""
    reference, _ = swinging(decay=3)
    broken = reference.copy()
    broken[3, 0] = np.nan
    rest = np.array([0.01, -0.01])
    for distance in ([[0.01, np.nan]], [[np.nan, np.nan]], [[0.01, 0.01], [np.nan, -0.1]]):
        assert np.isnan(list(metrics.penetration(np.array(distance), rest).values())).all()
    for pair in ((broken, reference), (reference, broken), (broken, broken)):
        assert np.isnan(list(metrics.motion_error(*pair, LENGTH).values())).all()
    assert np.isnan(metrics.settling_time(broken, TIMES, stop=0.0))
    for nothing_after in (TIMES[-1], 99.0, np.nan):
        assert np.isnan(metrics.settling_time(reference, TIMES, nothing_after))
        assert np.isnan(metrics.echo(reference, reference, TIMES, nothing_after))


REFERENCE, _ = swinging()
DISTANCE, DOWN = np.ones((4, 5)), np.tile([0, -1.0, 0], (len(TIMES), 1))


@pytest.mark.parametrize(
    ("measure", "fact"),
    [
        (lambda hair: metrics.position_error(hair, hair[:1], LENGTH), r"reference: is of shape \(1, 2, 24, 3\); give"),
        (lambda hair: metrics.motion_error(hair, hair[:1], LENGTH), "reference: is of shape"),
        (lambda hair: metrics.velocity_error(hair, hair[:1], TIMES), "reference: is of shape"),
        (lambda hair: metrics.motion_ratio(hair, hair[:, :1], TIMES), "reference: is of shape"),
        (lambda hair: metrics.echo(hair, hair[:, :1], TIMES, 0.0), "reference: is of shape"),
        (lambda hair: metrics.dynamic_frames(hair, hair[:, :1], TIMES), "reference: is of shape"),
        (lambda hair: metrics.position_error(hair, hair, LENGTH[:1]), "length: give .* for each of 2 strands"),
        (lambda hair: metrics.position_error(hair, hair, LENGTH * [1, 0]), "length: give .* above 0"),
        (lambda hair: metrics.motion_error(hair, hair, -LENGTH), "length: give .* above 0"),
        (lambda hair: metrics.position_error(hair[:0], hair[:0], LENGTH), "points: is of shape .0, 2, 24, 3.; give"),
        (lambda hair: metrics.speed(hair[:, 0], TIMES), "points: is of shape"),
        (lambda hair: metrics.speed(hair, TIMES[::-1]), "times: give ascending seconds"),
        (lambda hair: metrics.settling_time(hair, TIMES[:-1], 0.0), "times: give ascending seconds"),
        (lambda hair: metrics.held(np.zeros((80, 1, 4, 4)), TIMES[:80][::-1]), "times: give ascending seconds"),
        (lambda hair: metrics.held(np.zeros((80, 4, 4)), TIMES[:80]), "joints: is of shape .80, 4, 4.; give"),
        (lambda hair: metrics.held([[1, 2], [3]], TIMES[:2]), "joints: is not an array of numbers"),
        (lambda hair: metrics.held(np.zeros((80, 0, 4, 4)), TIMES[:80]), "joints: are of shape"),
        (lambda hair: metrics.settling_time(hair, TIMES, None), "stop: is not an array of numbers; give a number of s"),
        (lambda hair: metrics.echo(hair, hair, TIMES, [0.0, 1.0]), "stop: is of shape .2,.; give a number of seconds"),
        (lambda hair: metrics.turning(LENGTH), "points: are of shape .2,.; give strands"),
        (lambda hair: metrics.strand_lengths(LENGTH, [2]), "points: are of shape .2,.; give strands"),
        (lambda hair: metrics.strand_lengths(hair[0, 0], [20]), "counts: give .* add up to the 24 points"),
        (lambda hair: metrics.strand_lengths(hair[0, 0], [12.0, 12.0]), "counts: give whole numbers"),
        (lambda hair: metrics.speed(hair, TIMES, 4.0), "cuts: is of shape"),
        (lambda hair: metrics.speed(hair, TIMES, "4"), "cuts: is not an array of numbers"),
        (lambda hair: metrics.tip_curves(hair.astype(str)), "displacement: is not an array of numbers"),
        (lambda hair: metrics.droop(hair, DOWN[:1]), "down: is of shape"),
        (lambda hair: metrics.jitter(hair[:0]), "points: are of shape"),
        (lambda hair: metrics.penetration(DISTANCE, DISTANCE[0, :1]), "distance: is of shape .4, 5., rest_distance of"),
        (lambda hair: metrics.penetration(DISTANCE[:0], DISTANCE[0]), "distance: is of shape"),
        (lambda hair: metrics.stretch(DISTANCE, DISTANCE[:, 0]), "lengths: is of shape .4, 5., rest of .4,."),
    ],
)
def test_what_does_not_fit_together_is_refused(measure, fact):
    with pytest.raises(NeuralocksError, match=f"^{fact}"):
        measure(REFERENCE)


def test_whole_numbers_do_not_wrap_around_and_cuts_may_come_in_any_order():
    falling = np.zeros((3, 1, 2, 3), np.uint8)
    falling[:, :, :, 1] = np.array([2, 1, 0])[:, None, None]
    assert metrics.jitter(falling) == 1000
    assert (metrics.speed(falling, [0, 1, 2]) == 1).all()
    assert metrics.velocity_error(falling, falling + falling, [0, 1, 2]) == 0.5
    cuts = [1.0, 2.0, 3.0]
    assert np.array_equal(metrics.speed(REFERENCE, TIMES, cuts[::-1]), metrics.speed(REFERENCE, TIMES, cuts))


def test_droop_is_measured_along_gravity_in_the_heads_axes():
    displacement = np.zeros((3, 2, 24, 3))
    displacement[:, :, -1] = [0.0, 0.0, 0.03]
    down = np.array([[0, 0, 1.0], [0, 0, 1.0], [0, -1.0, 0]])
    assert metrics.droop(displacement, down) == pytest.approx(2)


def test_turning_of_a_circle_and_of_a_zigzag():
    angle = np.linspace(0, 2 * np.pi, 25)
    circle = 0.1 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    assert metrics.turning(circle[None]) == pytest.approx(15)
    zigzag = np.stack([np.arange(24.0), np.arange(24) % 2, np.zeros(24)], axis=1)
    assert metrics.turning(zigzag) == pytest.approx(90)
    assert metrics.turning(np.zeros((2, 24, 3))) == 0
