# SPDX-License-Identifier: Apache-2.0
"""Motion capture on the shipped body looks right: upright, on its feet, the same left and right."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from neuralocks_core.animation.retarget import _trunk_between, retarget
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.formats.bvh import read_bvh
from neuralocks_core.rotation import angle_between, from_vector
from tests.core.animation.written_bvh import NAMINGS, Z_UP, along_x, along_x_mirrored, write_bvh
from tests.core.rig.builders import character
from tests.shared_data import SHARED

REAL = SHARED / "motion"
FILES = sorted(REAL.glob("*.bvh"))
needs_capture = pytest.mark.skipif(not FILES, reason="the shared motion capture is not there")


@pytest.fixture(scope="module")
def woman():
    pytest.importorskip("pxr")
    from usd.shot.stage import read_rigs

    return read_rigs(Path(__file__).parents[3] / "examples" / "shot" / "body.usdc")[0].character


@cache
def take(path):
    return read_bvh(path)


def place(clip, character, name):
    return clip.joints[:, character.humanoid[name], :3, 3]


@needs_capture
@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_she_stands_on_her_feet_with_her_head_up(woman, path):
    clip = retarget(take(path), woman)
    head, hips = place(clip, woman, "head"), place(clip, woman, "hips")
    assert np.median(head[:, 1] - hips[:, 1]) > 0.45
    up = woman.relative_rotations(clip.joints, [woman.head])[:, 0, 1, 1]
    assert np.median(up) > 0.85
    soles = np.min([place(clip, woman, f"{side}_foot")[:, 1] for side in ("left", "right")], axis=0)
    stand = woman.skeleton.bind[woman.humanoid["left_foot"], 1, 3]
    assert abs(np.percentile(soles, 5) - stand) < 0.05
    # Bones keep their lengths.
    for child, parent in (("left_lower_arm", "left_upper_arm"), ("right_foot", "right_lower_leg"), ("head", "neck")):
        bone = place(clip, woman, child) - place(clip, woman, parent)
        bind = woman.skeleton.bind[:, :3, 3]
        length = np.linalg.norm(bind[woman.humanoid[child]] - bind[woman.humanoid[parent]])
        assert np.allclose(np.linalg.norm(bone, axis=1), length, atol=1e-9)


@needs_capture
@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_each_naming_gives_whole_limbs(path):
    """No socket without length is taken for a thigh or an arm, and both sides are found."""
    source = Character(take(path).skeleton)
    bind = source.skeleton.bind[:, :3, 3]
    for side in ("left", "right"):
        for upper, lower in (("upper_leg", "lower_leg"), ("lower_leg", "foot"), ("upper_arm", "lower_arm")):
            ends = [source.humanoid[f"{side}_{part}"] for part in (upper, lower)]
            assert source.skeleton.parents[ends[1]] == ends[0]
            assert np.linalg.norm(bind[ends[1]] - bind[ends[0]]) > 0.15


@needs_capture
def test_a_walk_walks(woman):
    clip = retarget(take(REAL / "02_01.bvh"), woman)
    hips = place(clip, woman, "hips")
    speed = np.linalg.norm(hips[-1] - hips[0]) / clip.end
    assert 0.6 < speed < 2.2
    # A standing foot does not slide: of both feet's heels and toes, the slowest hardly moves.
    feet = [place(clip, woman, f"{side}_foot") for side in ("left", "right")]
    toes = [i for i, name in enumerate(woman.skeleton.names) if name.rsplit("/", 1)[-1].startswith("ball")]
    feet += [clip.joints[:, toe, :3, 3] for toe in toes]
    velocity = [np.linalg.norm(np.gradient(f, clip.times, axis=0)[:, [0, 2]], axis=1) for f in feet]
    assert np.median(np.min(velocity, axis=0)) < 0.15
    # She walks the way she faces, her left side on her left.
    across = place(clip, woman, "left_upper_leg") - place(clip, woman, "right_upper_leg")
    front = np.cross(across, [0, 1, 0])
    assert np.mean(np.sum(front * (hips[-1] - hips[0]), axis=1) > 0) > 0.95


@needs_capture
def test_limbs_point_where_the_source_points(woman):
    """Bone directions are the source's own, whatever the rest poses."""
    for path in FILES[:1] + FILES[3:6]:
        motion = take(path)
        source = Character(motion.skeleton)
        clip = retarget(motion, woman)
        for child, joint in (("left_hand", "left_lower_arm"), ("right_foot", "right_lower_leg")):
            bones = []
            for who, joints in ((woman, clip.joints), (source, motion.clip.joints)):
                bone = (joints[:, who.humanoid[child]] - joints[:, who.humanoid[joint]])[:, :3, 3] @ who.facing.T
                bones.append(bone / np.linalg.norm(bone, axis=1, keepdims=True))
            assert np.allclose(*bones, atol=1e-6), path.name


def test_retargeting_to_a_turned_rig_turns_the_motion(woman, tmp_path):
    """A character bound facing another way moves the same, seen from its own front."""
    if not FILES:
        pytest.skip("the shared motion capture is not there")
    whole = np.eye(4)
    whole[:3, :3] = from_vector(np.array([0, 1.1, 0]))
    skeleton = woman.skeleton
    turned = Character(Skeleton(skeleton.names, skeleton.parents, whole @ skeleton.bind))
    motion = take(REAL / "02_01.bvh")
    straight, other = retarget(motion, Character(skeleton)), retarget(motion, turned)
    assert np.allclose(whole @ straight.joints, other.joints, atol=1e-9)


POSE = {
    "hips": (0, 0, 40),
    "chest": (5, 12, 0),
    "neck": (0, 8, 10),
    "head": (6, 20, 25),
    "left_arm": (70, 0, 0),
    "right_forearm": (0, 0, 80),
}
"""Turned as a whole by 40 degrees, bent, with one arm up and the other elbow bent to the front."""


def turned(z, x, y):
    """Turns about Z, X and Y [degrees], in the order of the file's channels."""
    each = zip(np.radians([z, x, y]), np.eye(3)[[2, 0, 1]], strict=True)
    return np.linalg.multi_dot([from_vector(angle * axis) for angle, axis in each])


@pytest.mark.parametrize("naming", NAMINGS)
def test_a_written_pose_is_taken_whatever_the_joints_are_called(woman, tmp_path, naming):
    clip = retarget(read_bvh(write_bvh(tmp_path / "take.bvh", [{}, POSE], naming)), woman)
    hips, chest, neck, head = (turned(*POSE[part]) for part in ("hips", "chest", "neck", "head"))
    turns = woman.relative_rotations(clip.joints, [woman.humanoid[n] for n in ("hips", "chest", "neck", "head")])
    assert np.allclose(turns[0], np.eye(3), atol=1e-9)
    assert np.allclose(turns[1, 0], hips, atol=1e-9)
    assert np.allclose(turns[1, 2:], [hips @ chest @ neck, hips @ chest @ neck @ head], atol=1e-9)
    for child, joint, bone in (
        ("left_lower_arm", "left_upper_arm", hips @ chest @ turned(*POSE["left_arm"]) @ [1, 0, 0]),
        ("right_hand", "right_lower_arm", hips @ chest @ turned(*POSE["right_forearm"]) @ [-1, 0, 0]),
        ("left_foot", "left_lower_leg", hips @ [0, -1, 0]),
    ):
        way = (place(clip, woman, child) - place(clip, woman, joint))[1]
        assert np.allclose(way / np.linalg.norm(way), bone, atol=1e-9), child


def test_written_steps_are_as_long_as_her_legs(woman, tmp_path):
    """Twice the source's leg forward is twice hers; up and down likewise."""
    leg = 84.0
    places = [(0, 95, 0), (0, 95, 2 * leg), (0, 95 + leg / 4, 2 * leg)]
    clip = retarget(read_bvh(write_bvh(tmp_path / "take.bvh", [{}] * 3, places=places)), woman)
    bind = woman.skeleton.bind[:, :3, 3]
    thigh, shin, foot = (bind[woman.humanoid[f"left_{part}"]] for part in ("upper_leg", "lower_leg", "foot"))
    hers = np.linalg.norm(shin - thigh) + np.linalg.norm(foot - shin)
    hips = place(clip, woman, "hips")
    assert np.allclose(hips[1:] - hips[0], [[0, 0, 2 * hers], [0, hers / 4, 2 * hers]], atol=1e-6)


BENT = {
    "hips": (0, 0, -20),
    **{f"{side}_shin": (0, 30, 0) for side in ("left", "right")},
    "left_forearm": (0, 0, -60),
    "right_forearm": (0, 0, 50),
    "right_arm": (50, 0, 0),
}
"""A motion that reveals the hinges of all elbows and knees."""


@pytest.mark.parametrize("up", ["Y", "Z"])
@pytest.mark.parametrize("axes", [along_x, along_x_mirrored])
def test_a_person_whose_zero_pose_is_no_pose_stands(woman, tmp_path, axes, up):
    """All bones may point along one axis of their joints: with zero turns, head and feet are then at one end."""
    frames = [{}, POSE, BENT, {}]
    expected = retarget(read_bvh(write_bvh(tmp_path / "take.bvh", frames)), woman)
    path = write_bvh(tmp_path / "odd.bvh", frames, axes=axes, turn=Z_UP if up == "Z" else None)
    motion = read_bvh(path)
    assert (motion.unit, motion.up, motion.guessed) == (0.01, up, True)
    clip = retarget(motion, woman)
    limbs = [f"{s}_{p}" for s in ("left", "right") for p in ("upper_arm", "lower_arm", "upper_leg", "lower_leg")]
    joints = [woman.humanoid[name] for name in ("hips", "head", *limbs)]
    turns, same = (woman.relative_rotations(c.joints, joints) for c in (clip, expected))
    assert np.degrees(angle_between(turns, same)).max() < 1e-3
    hips = place(clip, woman, "hips")
    assert np.allclose(hips, place(expected, woman, "hips"), atol=1e-3)
    # The trunk's bones go where the source's go.
    for child, joint, chain in (
        ("neck", "upper_chest", ["hips", "chest"]),
        ("head", "neck", ["hips", "chest", "neck"]),
    ):
        way = (place(clip, woman, child) - place(clip, woman, joint))[1]
        bone = np.linalg.multi_dot([*(turned(*POSE[part]) for part in chain), [0, 9, 1 if child == "head" else 0]])
        assert np.allclose(way / np.linalg.norm(way), bone / np.linalg.norm(bone), atol=1e-3)


def test_limbs_that_never_bend_are_not_twisted(woman, tmp_path):
    frames = [{}, {"left_arm": (30, 0, 0)}, {"right_thigh": (0, -20, 0)}]
    clips = [retarget(read_bvh(write_bvh(tmp_path / "take.bvh", frames, axes=axes)), woman) for axes in (None, along_x)]
    joints = [woman.humanoid[f"{side}_{part}"] for side in ("left", "right") for part in ("lower_arm", "lower_leg")]
    same, turns = (woman.relative_rotations(clip.joints, joints) for clip in clips)
    assert np.degrees(angle_between(turns, same)).max() < 1e-3


@pytest.mark.parametrize("zero", ["Y", "Z", "-Y"])
@pytest.mark.parametrize("up", ["Y", "Z"])
def test_a_person_may_stand_along_another_axis(woman, tmp_path, up, zero):
    """In the file, or only before a turn of the root."""
    frames = [{}, POSE, BENT]
    expected = retarget(read_bvh(write_bvh(tmp_path / "take.bvh", frames)), woman)
    turns = {"Y": np.eye(3), "Z": Z_UP, "-Y": np.diag([-1.0, -1, 1])}
    path = write_bvh(tmp_path / "turned.bvh", frames, axes=lambda part: turns[zero].T, turn=turns[up])
    motion = read_bvh(path)
    if (zero, up) == ("Y", "Z"):
        assert motion.up == "Y", "it may lie on its back: a zero pose that stands is believed"
        return
    assert (motion.unit, motion.up, motion.guessed) == (0.01, up, False)
    clip = retarget(motion, woman)
    assert np.allclose(clip.joints, expected.joints, atol=1e-6)


def test_without_toes_ankles_tell_where_the_floor_is(tmp_path):
    """In a take that is recorded above it."""
    motion = read_bvh(write_bvh(tmp_path / "take.bvh", [{}] * 3, places=[(0, 130, 0)] * 3))
    who = Character(read_bvh(write_bvh(tmp_path / "stands.bvh", [{}])).skeleton)
    assert not set(who.skeleton.parents) & {who.humanoid[f"{side}_foot"] for side in ("left", "right")}
    np.testing.assert_allclose(retarget(motion, who).joints[1], who.skeleton.bind, atol=1e-9)


def test_joints_that_the_take_lacks_follow_or_turn_half_way(tmp_path):
    """A tail follows its hips; in a trunk, each joint lies between those that turn, the lower one first."""
    who = character([("tail", "hips", (0, 1, -0.2))])
    clip = retarget(read_bvh(write_bvh(tmp_path / "take.bvh", [{}, POSE])), who)
    turns = who.relative_rotations(clip.joints, [who.humanoid["hips"], len(who.skeleton.names) - 1])
    assert np.allclose(turns[1, 0], turned(*POSE["hips"])) and np.allclose(turns[:, 1], turns[:, 0])
    nods = {"hips": 0.0, "upper_chest": 0.4, "head": 0.8}
    found = _trunk_between({name: from_vector(np.array([[nod, 0, 0]])) for name, nod in nods.items()})
    for name, nod in (nods | {"spine": 0.2, "chest": 0.3, "neck": 0.6}).items():
        np.testing.assert_allclose(found[name], from_vector(np.array([[nod, 0, 0]])), atol=1e-12)
