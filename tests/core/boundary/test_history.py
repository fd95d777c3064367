# SPDX-License-Identifier: Apache-2.0
"""The boundary history sees what matters and nothing else."""

import numpy as np
import pytest

from neuralocks_core import rotation
from neuralocks_core.boundary.history import BoundarySampler
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.boundary.sudden_stops import softened
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.materials import Material
from neuralocks_core.motion import Clip
from neuralocks_core.wind import Wind
from tests.core.rig.builders import character as with_elbows
from tests.core.rigs import HEAD, bind, moved, person

SPEC = BoundarySpec(bins=(1,) * 30, taper=0.0)


def history(vectors, spec=SPEC):
    return vectors[:, spec.slices["history"]].reshape(len(vectors), len(spec.bins), -1)


def swing(t):
    return rotation.from_vector(np.stack([0 * t, 0.8 * np.sin(3 * t), 0 * t], axis=-1))


def test_effective_gravity_of_a_jump_is_what_mechanics_says():
    """Free fall is weightless: g - a = 0, so the change of effective gravity is +1 g upwards."""
    times = np.arange(0, 1, 1 / 60)
    sampler = BoundarySampler(SPEC, person(), moved(times, lambda t: np.stack([0 * t, -0.5 * 9.81 * t**2, 0 * t], -1)))
    newest = history(sampler.vectors([0.7]))[0, 0]
    assert newest[:3] == pytest.approx([0, 1, 0], abs=2e-3)


@pytest.mark.parametrize("linear", ["gravity", "velocity"])
def test_heavy_hair_reads_what_light_hair_reads_in_slower_motion(linear):
    """Of twice the weight, in a motion and a steady wind; and of the usual weight in the same motion at 1 / sqrt(2) of the speed."""
    spec, times, root = BoundarySpec(linear=linear), np.arange(0, 4, 1 / 48), np.sqrt(2)

    def sampler(slower):
        def sideways(t):
            return np.stack([0.1 * np.sin(6 * t / slower), 0 * t, 0 * t], -1)

        return BoundarySampler(spec, person(), moved(times * slower, sideways, lambda t: swing(t / slower)))

    heavy = Material(bend=2e-3, weight=2.0, damping=8.0).log_ratios()
    light = Material(bend=1e-3, damping=8.0 / root).log_ratios()
    wind = (Wind((0, 0, 4), 0.0), Wind((0, 0, 2), 0.0)) if linear == "gravity" else (None, None)
    read = sampler(1.0).vectors([2.0, 2.7], heavy, wind=wind[0])
    other = sampler(root).vectors([2.0 * root, 2.7 * root], light, wind=wind[1])
    weight = spec.slices["material"].start + 1
    assert (read[:, weight] > 0).all()
    np.testing.assert_allclose(np.delete(read, weight, 1), np.delete(other, weight, 1), atol=2e-5)


def test_constant_speed_is_no_motion():
    sampler = BoundarySampler(SPEC, person(), moved(np.arange(0, 2, 1 / 24), lambda t: np.stack([3 * t, 0 * t, t], -1)))
    assert np.abs(history(sampler.vectors([0.0, 0.5, 1.5]))).max() < 1e-5


def turning(rate):
    """A turn about the world's y axis at `rate` rad/s."""
    return lambda t: rotation.from_vector(np.outer(rate * t, [0, 1, 0]))


def test_spin_is_read_in_head_axes():
    """A head that is bent by 0.7 rad about its x axis has the world's y axis at (0, cos 0.7, -sin 0.7), also if it is turned by
    half a round, past which its quaternion has the other sign.
    """
    clip = moved(np.arange(90) / 30, None, lambda t: turning(2.0)(t) @ rotation.from_vector([0.7, 0, 0]))
    assert history(BoundarySampler(SPEC, person(), clip).vectors([2.01]))[0, :, 3:6] == pytest.approx(
        np.tile([0, 2 * np.cos(0.7), -2 * np.sin(0.7)], (30, 1)), abs=1e-3
    )


def test_a_turn_beyond_what_was_learned_is_cut_off():
    """At 25 rad/s, as README.md says. It is sampled finely, or it would be taken for a slower turn the other way."""
    clip = moved(np.arange(0, 2, 1 / 240), None, turning(60.0))
    assert history(BoundarySampler(SPEC, person(), clip).vectors([1.5]))[0, :, 3:6] == pytest.approx(
        np.tile([0, 25.0, 0], (30, 1)), abs=1e-4
    )


@pytest.mark.parametrize("rate", [24, 25, 60])
def test_frame_rates_agree(rate):
    """The same motion sampled at any rate gives the same history, up to what the samples can hold."""

    def sample(fps):
        clip = moved(np.arange(0, 3, 1 / fps), lambda t: np.stack([0.1 * np.sin(6 * t), 0 * t, 0 * t], -1), swing)
        return BoundarySampler(BoundarySpec(), person(), clip).vectors([1.5, 2.0])

    assert np.abs(sample(rate) - sample(240)).max() < 0.01


def test_what_is_read_of_hair_on_a_joint_below_the_head_is_the_heads_as_that_joint_has_it():
    """A jaw that does not move relative to the head changes nothing; one that turns little changes little."""
    jaw, times = [0.0, -0.05, 0.08], np.arange(0, 2, 1 / 24)
    plain = moved(times, lambda t: np.stack([0.2 * np.sin(5 * t), 0 * t, 0 * t], -1), swing)
    skeleton = person().skeleton
    at = np.eye(4)
    at[:3, 3] = jaw
    names, parents = (*skeleton.names, f"{skeleton.names[HEAD]}/jaw"), (*skeleton.parents, HEAD)
    bound = Skeleton(names, parents, np.concatenate([skeleton.bind, skeleton.bind[[HEAD]] @ at]))

    def read(carrier, angle):
        turn = np.tile(np.eye(4), (len(times), 1, 1))
        turn[:, :3, :3] = rotation.from_vector(np.outer(angle * np.sin(3 * times), [1.0, 0, 0]))
        joints = np.concatenate([plain.joints, plain.joints[:, [HEAD]] @ (at @ turn)[:, None]], axis=1)
        return BoundarySampler(SPEC, Character(bound, carrier=carrier), Clip(times, joints)).vectors([0.2, 1.0])

    head = read(None, 0.0)
    assert np.abs(head - BoundarySampler(SPEC, person(), plain).vectors([0.2, 1.0])).max() < 1e-6
    assert np.abs(read(6, 0.0) - head).max() < 1e-5
    assert 1e-4 < np.abs(read(6, 0.001) - head).max() < 0.02


def test_a_rig_turned_or_with_other_joint_axes_reads_the_same():
    times = np.arange(0, 2, 1 / 30)
    plain = moved(times, lambda t: np.stack([0.2 * np.sin(5 * t), 0 * t, 0 * t], -1), swing)
    expected = BoundarySampler(SPEC, person(), plain).vectors([1.0])
    turn = rotation.from_vector([0.0, 1.1, 0.0])
    whole = np.eye(4)
    whole[:3, :3] = turn
    turned = Clip(times, whole @ plain.joints)
    assert BoundarySampler(SPEC, person(turn), turned).vectors([1.0]) == pytest.approx(expected, abs=1e-5)
    orient = np.tile(np.eye(4), (6, 1, 1))
    orient[:, :3, :3] = rotation.from_vector(np.random.default_rng(0).normal(size=(6, 3)))
    character = person()
    oriented = type(character)(
        type(character.skeleton)(character.skeleton.names, character.skeleton.parents, bind() @ orient)
    )
    assert BoundarySampler(SPEC, oriented, Clip(times, plain.joints @ orient)).vectors([1.0]) == pytest.approx(
        expected, abs=1e-5
    )


def test_motion_strength_zero_is_the_held_pose():
    times = np.arange(0, 2, 1 / 30)
    clip = moved(times, lambda t: np.stack([0.2 * np.sin(5 * t), 0 * t, 0 * t], -1), swing)
    held = Clip([0.0], clip.at([1.0]))
    moving = BoundarySampler(SPEC, person(), clip).vectors([1.0], strength=0.0)
    still = BoundarySampler(SPEC, person(), held).vectors([0.0])
    assert moving == pytest.approx(still, abs=1e-5)


def test_the_bind_pose_held_is_the_anchor():
    sampler = BoundarySampler(SPEC, person(), moved([0.0]))
    assert np.array_equal(sampler.vectors([0.0])[0], sampler.held_bind())


def test_arms_bound_down_read_as_arms_bound_out():
    """One held pose of one character, bound in T-pose and with its arms 50 degrees down: an arm's turn is measured from T-pose."""
    t_pose, down, held = with_elbows(), np.radians(50.0), rotation.from_vector([0.3, 0.2, -0.6])
    bound, posed = [t_pose.skeleton.bind.copy() for _ in range(2)], []
    lowered = {side: rotation.from_vector([0, 0, -sign * down]) for side, sign in (("left", 1), ("right", -1))}
    for side, turn in lowered.items():
        arm, elbow = t_pose.humanoid[f"{side}_upper_arm"], t_pose.humanoid[f"{side}_lower_arm"]
        bound[1][elbow, :3, 3] = bound[1][arm, :3, 3] + turn @ (bound[1][elbow, :3, 3] - bound[1][arm, :3, 3])
    for own, back in zip(bound, (False, True)):
        posed.append(own.copy())
        for side, turn in lowered.items():
            posed[-1][t_pose.humanoid[f"{side}_upper_arm"], :3, :3] = held @ turn.T if back else held
    people = [Character(Skeleton(t_pose.skeleton.names, t_pose.skeleton.parents, own)) for own in bound]
    read = [BoundarySampler(SPEC, who, Clip([0.0], [pose])).vectors([0.0])[0] for who, pose in zip(people, posed)]
    assert read[1] == pytest.approx(read[0], abs=1e-6)
    for who, own, angle in zip(people, bound, (0.0, down)):
        sampler = BoundarySampler(SPEC, who, Clip([0.0], [own]))
        assert np.array_equal(sampler.vectors([0.0])[0], sampler.held_bind())
        left, right = sampler.held_bind()[SPEC.slices["pose"]].reshape(-1, 2, 3)[4:]
        c, s = np.cos(angle), np.sin(angle)
        assert left == pytest.approx(np.array([[c, -s, 0], [s, c, 0]]), abs=1e-6)
        assert right == pytest.approx(np.array([[c, s, 0], [-s, c, 0]]), abs=1e-6)


def test_one_time_or_many_give_the_same_bits():
    clip = moved(np.arange(0, 2, 1 / 24), None, swing)
    sampler = BoundarySampler(BoundarySpec(), person(), clip)
    times = np.array([0.3, 1.7, 0.9])
    together = sampler.vectors(times)
    assert all(np.array_equal(sampler.vectors([t])[0], row) for t, row in zip(times, together))


@pytest.mark.parametrize("sway", [0.1, 0.0])
def test_a_loop_has_no_seam(sway):
    """Also one with a walk: it continues from where it has come to, and at constant speed nothing is felt."""
    times = np.linspace(0, 2, 49)
    clip = moved(times, lambda t: np.stack([1.5 * t + sway * np.sin(np.pi * t), 0 * t, 0 * t], -1), loop=True)
    sampler = BoundarySampler(SPEC, person(), clip)
    assert sampler.vectors([0.05]) == pytest.approx(sampler.vectors([2.05]), abs=1e-5)
    assert np.abs(sampler.vectors([0.0]) - sampler.vectors([2.0])).max() < 1e-5
    felt = np.abs(history(sampler.vectors([0.05]))).max()
    assert felt == pytest.approx(sway * np.pi**2 / 9.81, rel=0.02, abs=1e-5)


def test_at_the_seam_of_a_loop_its_acceleration_is_that_of_the_motion_gone_on_with():
    times, spans = np.linspace(0, 2, 49), np.linspace(-2, 4, 145)

    def sway(t):
        return np.stack([0.2 * np.cos(np.pi * t), 0.1 * np.cos(3 * np.pi * t), 0 * t], -1)

    around = np.array([0.0, 0.02, 0.1, 1.95, 2.0])
    loop, whole = (
        BoundarySampler(SPEC, person(), each) for each in (moved(times, sway, loop=True), moved(spans, sway))
    )
    assert loop.vectors(around) == pytest.approx(whole.vectors(around), abs=1e-3)


def test_a_cut_counts_from_its_own_sample_on_however_its_time_was_rounded():
    times = np.arange(48) / 24

    def leap(t):
        return np.stack([0.1 * np.sin(5 * t) + 3.0 * (t > 0.99), 0 * t, 0 * t], -1)

    whole = Clip(times, moved(times, leap).joints, cuts=[1.0])
    after = Clip(times[24:], whole.joints[24:])
    cut, alone = (BoundarySampler(SPEC, person(), clip) for clip in (whole, after))
    at = [1.0 - 1e-12, 1.0, 1.0 + 1e-12, 1.2]
    assert np.abs(history(cut.vectors(at))).max() < 1
    assert cut.vectors(at) == pytest.approx(alone.vectors(at), abs=1e-6)


@pytest.mark.parametrize(("linear", "limit"), [("gravity", 6.0), ("velocity", 25.0)])
def test_a_leap_within_a_loop_is_bounded(linear, limit):
    """A loop has no cuts, and its path stays as it is, or its seam would not fit: what is felt of a jump is limited, to 6 g as
    README.md says, or to 25 m/s.
    """
    spec = BoundarySpec(bins=(1,) * 30, taper=0.0, linear=linear)
    clip = moved(
        np.arange(49) / 24, lambda t: np.stack([40.0 * np.exp(-400 * (t - 1) ** 2), 0 * t, 0 * t], -1), loop=True
    )
    assert softened(clip, person(), 6.0, SPEC.dt) is clip
    felt = np.linalg.norm(history(BoundarySampler(spec, person(), clip).vectors([1.2]), spec)[0, :, :3], axis=-1)
    assert felt.max() == pytest.approx(limit, rel=1e-5)


def test_a_teleport_is_bounded():
    clip = moved(np.arange(60) / 30, lambda t: np.stack([100.0 * (t > 1), 0 * t, 0 * t], -1))
    values = history(BoundarySampler(SPEC, person(), clip).vectors(np.arange(60) / 30))
    assert np.isfinite(values).all()
    assert np.linalg.norm(values[..., :3], axis=-1).max() <= BoundarySampler.GRAVITY_LIMIT + 1e-5


@pytest.mark.parametrize("rate", [24, 30, 60, 144])
def test_a_sudden_start_is_felt_alike_in_all_frames_after_it(rate):
    """At 4 m/s from one frame to the next: with a limit per step alone, twice as much was passed on in every second frame at 60
    fps, where two steps shared the blow.
    """
    times = np.arange(0, 2, 1 / rate)
    path = moved(times, lambda t: np.stack([4.0 * np.maximum(t - 0.5, 0), 0 * t, 0 * t], -1))
    sampler = BoundarySampler(SPEC, person(), path)
    blow = history(sampler.vectors(times[(times > 0.7) & (times < 1.3)])).sum(axis=1)[:, 0] * SPEC.dt
    assert np.ptp(blow) < 0.15 * np.abs(blow).mean(), blow
    assert np.abs(blow).mean() == pytest.approx(6 * max(1 / rate, SPEC.dt), rel=0.1)


def test_a_path_without_blows_is_read_as_it_is():
    times = np.arange(0, 2, 1 / 60)
    path = moved(times, lambda t: np.stack([0.3 * np.sin(12 * t), 0.2 * np.sin(9 * t), 0 * t], -1))
    assert softened(path, person(), 6.0, SPEC.dt) is path
