# SPDX-License-Identifier: Apache-2.0
"""The body is measured on its own skin, in its own shape, and read within what a network learned."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from neuralocks_core.boundary.history import BoundarySampler
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.measures import AVERAGE, HIGHEST, LOWEST, body_measures
from neuralocks_core.skinned_body import Body
from tests.core.rigs import HEAD, POSITIONS, moved, person

SPINE, NECK = 1, 2
SPEC = BoundarySpec()


def _skin():
    """A person as one tall egg, and the joint that each point follows."""
    egg = trimesh.creation.uv_sphere(radius=1.0, count=[60, 40])
    points = egg.vertices * [0.12, 0.45, 0.11] + [0, 1.35, 0]
    return points, egg.faces, np.where(points[:, 1] > 1.6, HEAD, np.where(points[:, 1] > 1.5, NECK, SPINE))


def _ball(centre, size, joint):
    ball = trimesh.creation.icosphere(2)
    return ball.vertices * size + centre, ball.faces, np.full(len(ball.vertices), joint)


def _cards():
    """A sheet behind the head that continues into the neck."""
    x, y = np.meshgrid(np.linspace(-0.1, 0.1, 9), np.linspace(1.3, 1.75, 16))
    corner = (np.arange(8) + 9 * np.arange(15)[:, None]).reshape(-1, 1)
    points = np.stack([x, y, 0 * x - 0.3], axis=-1).reshape(-1, 3)
    return points, corner + [0, 1, 9], np.where(points[:, 1] > 1.5, HEAD, NECK)


WORN = {
    "straw hat": _ball([0, 1.8, 0], [0.3, 0.1, 0.3], HEAD),
    "halo": _ball([0, 2.1, 0], 0.15, HEAD),
    "cards": _cards(),
    "pack": _ball([0, 1.4, -0.3], 0.2, SPINE),
}


def _dressed(*pieces, shapes=None) -> Character:
    starts = np.cumsum([0] + [len(points) for points, _, _ in pieces])
    points = np.concatenate([points for points, _, _ in pieces])
    triangles = np.concatenate([faces + start for (_, faces, _), start in zip(pieces, starts)])
    joints = np.concatenate([joints for _, _, joints in pieces])[:, None]
    return Character(person().skeleton, Body(points, triangles, joints, np.ones(joints.shape), shapes or {}))


def _split(points, faces, joints):
    """Every face with its own points, as files split a skin along seams."""
    return points[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3), joints[faces].reshape(-1)


def _two_meshes(points, faces, joints):
    """Head and trunk, each bound to a single joint."""
    upper = (joints[faces] == HEAD).all(axis=1)
    parts = [(points, faces[upper], np.full(len(points), HEAD)), (points, faces[~upper], np.minimum(joints, NECK))]
    kept = [np.unique(faces) for _, faces, _ in parts]
    return [(p[k], np.searchsorted(k, f), j[k]) for k, (p, f, j) in zip(kept, parts)]


@pytest.mark.parametrize("worn", WORN)
@pytest.mark.parametrize("skin", ["one piece", "seams", "two meshes"])
def test_what_is_worn_is_no_part_of_head_or_back(skin, worn):
    pieces = {"one piece": [_skin()], "seams": [_split(*_skin())], "two meshes": _two_meshes(*_skin())}[skin]
    bare, dressed = _dressed(*pieces), _dressed(*pieces, WORN[worn])
    assert np.array_equal(body_measures(bare), body_measures(dressed))
    assert np.array_equal(bare.head_centre, dressed.head_centre) and bare.head_width == dressed.head_width
    assert body_measures(bare)[:2] == pytest.approx([0.1, 0.2], abs=0.005)


def test_an_elfs_ears_do_not_lower_the_middle_of_its_head():
    """They are skin, above half of the head's height: hair would grow on the shoulders."""
    points, faces, joints = _skin()
    ear = (np.abs(points[:, 0]) > 0.07) & (points[:, 1] > 1.68)
    elf = points + np.where(ear, np.sign(points[:, 0]) * 0.2, 0)[:, None] * [1, 0, 0]
    before, after = (_dressed((p, faces, joints)) for p in (points, elf))
    assert ear.sum() > 4 and after.head_width - before.head_width > 0.35
    assert np.abs(after.head_centre - before.head_centre).max() < 0.015


def test_pigtails_on_joints_of_their_own_do_not_widen_a_robots_head():
    """The head is connected to nothing, so that its own skin cannot be told by what it continues into. If all of it is on such a joint,
    that is no pigtail.
    """
    head, trunk = _ball([0, 1.68, 0.02], 0.1, HEAD), _ball([0, 1.3, 0], 0.15, SPINE)
    bare = _dressed(head, trunk)
    skeleton = Skeleton(
        (*bare.skeleton.names, "tail"),
        np.append(bare.skeleton.parents, HEAD),
        bare.skeleton.bind[[*range(len(bare.skeleton.names)), HEAD]],
    )
    pigtails = [_ball([x, 1.7, 0], 0.15, len(bare.skeleton.names)) for x in (-0.4, 0.4)]
    who = replace(_dressed(head, trunk, *pigtails), skeleton=skeleton, humanoid=bare.humanoid)
    assert who.head_width == bare.head_width < 0.21 and who.skin.sum() == bare.skin.sum()
    below = _ball([0, 1.68, 0.02], 0.1, len(bare.skeleton.names))
    who = replace(_dressed(below, trunk), skeleton=skeleton, humanoid=bare.humanoid)
    assert who.head_width == bare.head_width and who.skin.all()


@pytest.mark.parametrize("worn", WORN)
def test_where_skin_cannot_be_told_every_mesh_counts(worn):
    """A head that is connected to nothing may as well be a hat."""
    head, trunk = _ball([0, 1.68, 0.02], 0.1, HEAD), _ball([0, 1.3, 0], 0.15, SPINE)
    assert _dressed(head, trunk).skin.all() and _dressed(head, trunk, WORN[worn]).skin.all()


def test_hair_below_whose_skin_was_taken_away_lies_on_clothes():
    head, trunk = _two_meshes(*_skin())
    neck = trunk[0][:, 1] > 1.55
    faces = trunk[1][neck[trunk[1]].all(axis=1)]
    coat = _ball([0, 1.3, 0], [0.25, 0.2, 0.15], SPINE)
    assert body_measures(_dressed(head, (trunk[0], faces, trunk[2]), coat))[9] == pytest.approx(0.14, abs=0.015)


def test_shapes_of_the_face_do_not_count_and_those_of_the_body_do():
    points, _, joints = _skin()
    face = (joints == HEAD) & (points[:, 2] > 0.05) & (np.abs(points[:, 1] - 1.65) < 0.05)
    chin = face | ((joints == NECK) & (points[:, 2] > 0.09))
    assert face.any() and (chin & ~face).any()
    forward, out = np.array([0, 0, 0.05]), points * [0.2, 0, 0.2]
    shapes = {
        "tongue": face[:, None] * forward,
        "jaw": chin[:, None] * forward + 1e-5,
        "heavy": out,
        "big head": (joints == HEAD)[:, None] * out,
        "stout": (joints != HEAD)[:, None] * out,
    }
    character = _dressed(_skin(), shapes=shapes)
    assert character.body_shapes.tolist() == [False, False, True, True, True]
    still, weights = body_measures(character), np.eye(5)
    assert all(np.array_equal(body_measures(character, weights[i]), still) for i in (0, 1))
    assert body_measures(character, weights[2])[[0, 2, 3, 9]] == pytest.approx(1.2 * still[[0, 2, 3, 9]])
    both = body_measures(character, weights[0] + weights[2])
    assert np.array_equal(both, body_measures(character, weights[2]))


def test_a_body_that_changes_in_time_is_measured_as_it_is_then():
    """A head that grows a tenth wider during the clip."""
    head = _ball(POSITIONS[HEAD] + [0, 0.02, 0], [0.085, 0.13, 0.104], HEAD)
    pieces = head, _ball([0, 1.3, 0], 0.11, SPINE)
    wider = np.concatenate([points for points, _, _ in pieces]) * [0.1, 0, 0]
    clip = replace(moved([0.0, 1.0]), shape=[[0.0], [1.0]])
    read = BoundarySampler(SPEC, _dressed(*pieces, shapes={"wide": wider}), clip).vectors([0.0, 0.5, 1.0])
    assert read[:, SPEC.slices["shape"]][:, 0] == pytest.approx(0.085 * np.array([1, 1.05, 1.1]), rel=1e-6)


def test_arms_behind_the_head_are_so_far_behind_it():
    skeleton = person().skeleton
    behind = skeleton.bind.copy()
    behind[4:, 2, 3] -= 0.03
    character = Character(Skeleton(skeleton.names, skeleton.parents, behind))
    assert body_measures(character)[6:9] == pytest.approx([0.2, 0.2, 0.03])


def test_a_network_reads_no_more_than_it_learned():
    clip, part = moved([0.0]), SPEC.slices["shape"]

    def read(*pieces):
        return BoundarySampler(SPEC, _dressed(*pieces), clip).vectors([0.0])[0, part]

    centre = POSITIONS[HEAD] + [0, 0.02, 0]
    trunk = _ball([0, 1.3, 0], 0.11, SPINE)
    assert np.array_equal(BoundarySampler(SPEC, person(), clip).held_bind()[part][:4], AVERAGE[:4].astype(np.float32))
    sizes = [0.09, 0.13, 0.104]
    usual = _ball(centre, sizes, HEAD), trunk
    assert np.array_equal(read(*usual), body_measures(_dressed(*usual)).astype(np.float32))
    large = _ball(centre, 0.4, HEAD), trunk
    assert np.array_equal(read(*large)[:4], HIGHEST[:4].astype(np.float32))
    small = _ball(centre - [0, 0.1, 0], 0.03, HEAD), trunk
    assert np.array_equal(read(*small)[:4], LOWEST[:4].astype(np.float32))


def test_what_is_not_known_is_the_middle_of_what_was_learned():
    """At a corner of the learned range, hair of a head without skin moved unlike that on any trained body."""
    bounded = np.isfinite(LOWEST)
    low, high = LOWEST[bounded], HIGHEST[bounded]
    assert (np.abs(AVERAGE[bounded] - (low + high) / 2) < 0.05 * (high - low)).all()
