# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's services, without Blender."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from pxr import Sdf

from dcc_addon.services import axes, bones, card, following, names, panel_errors, rig
from dcc_addon.services.history import SampledBoundary
from dcc_addon.services.leaps import leaps_told
from dcc_addon.services.mirror import mirrored
from dcc_addon.services.motion import Motion, frame_numbers, similar
from neuralocks_core import model
from neuralocks_core.animation.cuts import find_cuts
from neuralocks_core.boundary import BoundarySampler
from neuralocks_core.boundary_spec import BoundarySpec
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.evaluation.report import Card
from neuralocks_core.motion import Clip
from neuralocks_core.rotation import from_vector, transformed
from tests.core.rigs import moved, person

BONES = ("hips", "spine", "neck", "head", "upper_arm.L", "upper_arm.R")
PARENTS = np.array([-1, 0, 1, 2, 1, 1])
PLACES = np.array([[0, 0, 1], [0, 0, 1.2], [0, 0, 1.5], [0, 0, 1.6], [0.2, 0, 1.4], [-0.2, 0, 1.4]])


def _rest():
    rest = np.tile(np.eye(4), (6, 1, 1))
    rest[:, :3, 3] = PLACES
    return rest


def _motion(rng, scale=1.0, stretch=0.0):
    """World transforms (T, J, 4, 4) of a chain that turns at random, and the bind pose."""
    bind = scale * _rest()
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
    motion = Motion.from_world(np.arange(9), 24, 1.0, PARENTS, bind, world, np.zeros((9, 0)), {"": None})
    apart = motion.world() - world @ np.diag([1 / scale, 1 / scale, 1 / scale, 1])
    assert np.abs(apart[..., :3, :3]).max() < 1e-6
    assert np.abs(apart[..., :3, 3]).max() < 1e-6 * scale
    assert set(np.unique(motion.scale)) == {1.0}


def test_stretched_bones_keep_place_and_rotation():
    """A stretched bone has no single scale; what hair reads of it stays."""
    bind, world = _motion(np.random.default_rng(1))
    stretched = world @ np.diag([1.0, 1.7, 1.0, 1.0])
    result = similar(stretched)
    np.testing.assert_allclose(result[..., :3, 3], world[..., :3, 3])
    np.testing.assert_allclose(result[..., :3, :3] / 1.7 ** (1 / 3), world[..., :3, :3], atol=1e-9)


def _stretched(rng, apart=()):
    """World transforms (9, 6, 4, 4) of a chain whose joints turn and scale unevenly at random; those of `apart` inherit no
    scale.
    """
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
    motion = Motion.from_world(np.arange(9), 24, 1.0, PARENTS, _rest(), world, np.zeros((9, 0)), {}, head=3)
    assert np.abs(motion.world() - world).max() < 2e-3
    parts = [
        Motion.from_world(np.arange(9)[r], 24, 1.0, PARENTS, _rest(), world[r], np.zeros((9, 0))[r], {}, head=3)
        for r in (slice(2), slice(2, 9))
    ]
    assert np.array_equal(Motion.joined(parts, {}).world(), motion.world())


def test_a_head_that_inherits_no_stretch_is_exact():
    """Below it joints have one scale, for a chain cannot carry both; all stay in place."""
    world = _stretched(np.random.default_rng(6), apart=(3,))
    motion = Motion.from_world(np.arange(9), 24, 1.0, PARENTS, _rest(), world, np.zeros((9, 0)), {}, head=3)
    made = motion.world()
    assert np.abs(made[:, 3] - world[:, 3]).max() < 1e-3
    assert np.abs(made[..., :3, 3] - world[..., :3, 3]).max() < 1e-3
    assert np.ptp(np.linalg.norm(made[:, :3, :3, :3], axis=-2), axis=-1).max() < 1e-3


def test_an_unevenly_scaled_object_is_part_of_its_bind_pose():
    """At rest its joints are where they were bound, without scale."""
    place = np.diag([1.1, 1.0, 0.9, 1.0])
    motion = Motion.from_world([0], 24, 1.0, PARENTS, place @ _rest(), (place @ _rest())[None], np.zeros((1, 0)), {})
    arrays = rig.RigArrays("Rig", BONES, PARENTS, _rest())
    assert np.abs(motion.world()[0] - rig.bind_world(arrays, place)).max() < 1e-6


def test_mirrored_armature_is_refused_in_plain_words():
    with pytest.raises(NeuralocksError, match="Rig: it is mirrored .*apply its scale"):
        similar(np.diag([-1.0, 1, 1, 1])[None], "Rig")


def test_samples_are_found_by_frame():
    bind, world = _motion(np.random.default_rng(2))
    motion = Motion.from_world(np.arange(9) / 2 + 3, 25, 1.0, PARENTS, bind, world, np.zeros((9, 0)), {})
    assert [motion.row(f) for f in (3, 3.5, 7, 2, 3.3, 7.5)] == [0, 1, 8, None, None, None]
    assert motion.times[-1] == 7 / 25


def test_a_clips_own_samples_are_what_the_sampler_gives():
    """Kept or not, in blocks or alone: the same bits, also after a change of look, between samples, for another pose."""
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
    """Bones that scale the head: it stands as it is drawn, and the bind pose is as large as its hair is."""
    bind, world = _motion(np.random.default_rng(4))
    world[:, 3, :3, :3] *= size
    motion = Motion.from_world(np.arange(9), 24, 1.0, PARENTS, bind, world, np.zeros((9, 0)), {})
    shown = rig.size_shown(rig.RigArrays("Rig", BONES, PARENTS, _rest()), np.eye(4), motion.world()[:, 3])
    assert shown == pytest.approx(size, rel=1e-3)


def test_what_goes_with_the_head_alone_is_on_it():
    """A hat a metre in front of the head, which turns; where all stands still, or goes with the whole figure, nothing is known."""
    still = np.tile(np.eye(4), (5, 1, 1))
    turning = still.copy()
    turning[:, :3, :3] = from_vector(np.outer(np.linspace(0, 1, 5), [0, 0, 1]))
    hat, bind = np.eye(4), np.eye(4)
    hat[:3, 3], bind[:3, 3] = (0, -1, 0), (0, 0, 1.6)
    np.testing.assert_allclose(following.on_joint(turning @ hat, still, turning, bind), bind @ hat, atol=1e-12)
    assert following.on_joint(still @ hat, still, still, bind) is None
    assert following.on_joint(turning @ hat, turning, turning, bind) is None
    assert following.on_joint(still @ hat, still, turning, bind) is None


def test_a_beard_goes_with_the_jaw_where_the_head_does_not_take_it_along():
    """The first joint below the head that it does not move against; what a scale of zero hides carries nothing."""
    heads = np.tile(np.eye(4), (5, 1, 1))
    heads[:, :3, :3] = from_vector(np.outer(np.linspace(0, 1, 5), [0, 0, 1]))
    jaw, beard = heads.copy(), np.eye(4)
    jaw[:, :3, :3] = heads[:, :3, :3] @ from_vector(np.outer(np.linspace(0, 0.5, 5), [1, 0, 0]))
    beard[:3, 3] = (0, -0.1, 0)
    hidden = jaw.copy()
    hidden[2, :3, :3] = 0
    joints = {3: heads @ beard, 4: hidden, 5: jaw, 6: jaw @ beard}
    assert following.carrier_below(jaw @ beard, heads, [3, 4, 5, 6], joints.__getitem__) == 5
    assert following.carrier_below(heads @ beard, heads, [3, 4, 5, 6], joints.__getitem__) is None
    assert following.carrier_below(np.tile(beard, (5, 1, 1)), heads, [3, 4, 5, 6], joints.__getitem__) is None


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_mirrored_body_is_turned_right_side_out(side):
    """Two balls far apart, whose shape alone does not say which side is out."""
    ball = trimesh.creation.icosphere(2, 0.1)
    points = np.concatenate([ball.vertices, ball.vertices + [3.0, 0, 0]])
    body = rig.BodyArrays(
        "b", points, np.concatenate([ball.faces, ball.faces + len(ball.vertices)]), (), np.zeros((0, 3))
    )
    points, triangles, _ = rig.skin(body, np.diag([side, 1, 1, 1]))
    a, b, c = np.moveaxis(points[triangles].astype(float), 1, 0)
    assert np.einsum("fi,fi->", a, np.cross(b, c)) / 6 == pytest.approx(2 * ball.volume, rel=1e-5)


def test_a_motion_in_parts_is_the_whole():
    bind, world = _motion(np.random.default_rng(4))
    frames, shape, places = np.arange(9), np.arange(18.0).reshape(9, 2), {"": world[:, 0]}

    def of(rows):
        return Motion.from_world(frames[rows], 24, 1.0, PARENTS, bind, world[rows], shape[rows], {})

    whole, joined = of(slice(9)), Motion.joined([of(slice(4)), of(slice(4, 9))], places)
    for name in ("frames", "translation", "rotation", "scale", "shape"):
        assert np.array_equal(getattr(whole, name), getattr(joined, name)), name
    assert joined.places == places


def test_frame_numbers():
    np.testing.assert_allclose(frame_numbers(1, 3, 2), [1, 1.5, 2, 2.5, 3])
    assert list(frame_numbers(4, 4, 3)) == [4]
    with pytest.raises(NeuralocksError, match="ends at 1"):
        frame_numbers(2, 1, 1)


def test_blender_front_becomes_core_front():
    """Z up and looking along -Y becomes Y up and +Z; the unit is applied once."""
    core = axes.to_core(0.01)
    np.testing.assert_allclose(transformed([[0, -100, 0], [0, 0, 100], [100, 0, 0]], core),
                               [[0, 0, 1], [0, 1, 0], [1, 0, 0]], atol=1e-12)  # fmt: skip


def test_joint_paths_are_unique_and_accepted_by_usd():
    paths = names.joint_paths(["a.b", "a-b", "1c", "ä²", ""], [-1, 0, 0, 1, 1])
    assert paths == ["a_b", "a_b/a_b_2", "a_b/_1c", "a_b/a_b_2/ä_", "a_b/a_b_2/_"]
    assert all(Sdf.Path.IsValidPathString(path) for path in paths)
    assert names.unique(["Hair_ä"]) == ["Hair__"]  # a prim
    long = names.unique(["x" * 90, "x" * 90])
    assert len(set(long)) == 2 and max(map(len, long)) < 63


def test_a_rig_with_japanese_names_is_read_by_them():
    """As MMD's rigs come into Blender: the sides at the end, some numbers of full width."""
    bones = ("センター", "上半身", "上半身２", "首", "頭", "髪１", "腕.L", "ひじ.L", "腕.R", "ひじ.R", "下半身")
    parents = np.array([-1, 0, 1, 2, 3, 4, 2, 6, 2, 8, 0])
    miku = rig.RigArrays("Miku", bones, parents, np.broadcast_to(np.eye(4), (11, 4, 4)))
    assert all(Sdf.Path.IsValidPathString(path) for path in miku.paths)
    found = {part: bones[joint] for part, joint in miku.humanoid().items()}
    wanted = {
        "head": "頭",
        "neck": "首",
        "upper_chest": "上半身２",
        "left_upper_arm": "腕.L",
        "right_lower_arm": "ひじ.R",
    }
    assert wanted.items() <= found.items(), found


def test_parents_come_first():
    order = names.parents_first([2, 0, -1, 1])
    assert list(order) == [2, 0, 1, 3]


def test_weights_keep_the_strongest_four():
    rows = [(0, g, w) for g, w in enumerate((0.1, 0.4, 0.05, 0.3, 0.2))] + [(1, 5, 1.0)]
    body = rig.BodyArrays("b", np.zeros((3, 3)), np.zeros((0, 3), int), (*BONES[:5], "not a bone"), np.array(rows))
    indices, weights = rig.joint_weights(body, BONES)
    assert list(indices[0]) == [1, 3, 4, 0]
    np.testing.assert_allclose(weights[0], [0.4, 0.3, 0.2, 0.1])
    np.testing.assert_allclose(weights[1:], [[1, 0, 0, 0]] * 2)


def test_the_image_of_half_a_body_is_joined_along_the_seam():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 0, 1]])
    half = rig.BodyArrays(
        "Half",
        points,
        np.array([[0, 1, 2], [1, 3, 2]]),
        ("arm.L", "arm.R"),
        np.array([[0, 0, 0.5], [1, 0, 1.0]]),
        {"wide": np.array([[0, 0, 0], [0.5, 0, 0.25], [0, 0, 0], [0, 0, 0.0]])},
    )
    whole = mirrored(half, np.diag([-1.0, 1, 1, 1]), np.array([1, 0]), 0.01)
    assert np.array_equal(whole.points[4:], [[-1, 0, 0], [-1, 0, 1]])
    assert np.array_equal(whole.triangles[2:], [[2, 4, 0], [2, 5, 4]])
    assert np.array_equal(whole.weights, [[0, 0, 0.5], [1, 0, 1], [4, 1, 1]])
    assert np.array_equal(whole.shapes["wide"][4:], [[-0.5, 0, 0.25], [0, 0, 0]])
    assert len(mirrored(half, np.diag([-1.0, 1, 1, 1]), np.array([1, 0])).points) == 8


def test_character_faces_forward_and_says_what_is_missing():
    found = rig.RigArrays("Rig", BONES, PARENTS, _rest())
    character = rig.character(found, np.eye(4))
    np.testing.assert_allclose(character.facing, np.eye(3), atol=1e-9)
    assert character.skeleton.names[character.head].endswith("/head")
    assert rig.advice(found) == []
    lame = rig.RigArrays("Rig", BONES[:4], PARENTS[:4], _rest()[:4])
    assert any("left arm" in line for line in rig.advice(lame))


@pytest.mark.parametrize(
    ("bones", "head", "words"),
    [
        ((), "", "has no bones"),
        (("a", "b"), "", "no bone is named like a head"),
        (("a", "head"), "skull", "no bone 'skull'"),
    ],
)
def test_rig_problems_in_plain_words(bones, head, words):
    parents = np.arange(len(bones)) - 1
    with pytest.raises(NeuralocksError, match=words):
        rig.RigArrays("Rig", bones, parents, _rest()[: len(bones)], head).humanoid()


@pytest.mark.parametrize(
    ("points", "counts", "words"),
    [
        (np.zeros((0, 3)), [], "no strands"),
        (np.zeros((3, 3)), [1, 1, 1], "one point"),
        (np.full((2, 3), np.nan), [2], "finite"),
    ],
)
def test_bad_hair_in_plain_words(points, counts, words):
    with pytest.raises(NeuralocksError, match=words):
        rig.groom("Hair", points, np.array(counts, int), np.eye(4))


def test_errors_name_what_the_panel_has(tmp_path):
    """No option and no command of a terminal, whatever the chains are called."""
    skeleton = Skeleton(BONES, PARENTS, _rest())
    character = Character(skeleton, None, rig.RigArrays("Rig", BONES, PARENTS, _rest()).humanoid())
    for patterns in ("", "curl*", "spine", "head"):
        with pytest.raises(NeuralocksError) as error:
            bones.chains_of(character, patterns, "Rig")
        assert "--" in str(error.value) and "skeleton:" not in str(error.value)
        assert "--" not in (said := panel_errors.for_the_panel(str(error.value))) and "neuralocks " not in said, said
    with pytest.raises(NeuralocksError) as error:
        model.read(tmp_path / "nowhere.neuralocks", "strands")
    assert "--" not in panel_errors.for_the_panel(str(error.value))


def test_card_fits_a_sidebar():
    lines = card.lines_of(
        Card("t", {"/Hair": {"droop_cm": 1.234, "settling_s": float("nan"), "strands": 7}}, notes=("n",))
    )
    assert lines == ["droop: 1.23 cm", "n"]


def test_leaps_are_told_by_their_frames():
    """A cut, and two leaps in succession that are none."""
    frames = np.arange(10, 74)
    joints = np.tile(np.eye(4), (64, 1, 1, 1))
    joints[:, 0, 1, 3] = 0.01 * np.sin(np.arange(64))
    for first in (20, 50, 54):
        joints[first:, 0, 0, 3] += 1.0
    clip = Clip(frames / 24, joints)
    clip = replace(clip, cuts=find_cuts(clip, 0))
    cut, flash = leaps_told(clip, 0, frames)
    assert cut == "The head is put elsewhere at frame 30: hair starts anew there"
    assert flash.startswith("The head leaps at frame 60, 64, less than 0.2 s from one leap to the next")
    still = Clip(frames / 24, np.tile(np.eye(4), (64, 1, 1, 1)))
    for many, named in ((6, "10, 18, 26, 34, 42, 50:"), (7, "10, 18, 26, 34, 42, 50, ...:")):
        (cut,) = leaps_told(replace(still, cuts=still.times[: 8 * many : 8]), 0, frames)
        assert named in cut
    assert leaps_told(still, 0, frames) == ()
