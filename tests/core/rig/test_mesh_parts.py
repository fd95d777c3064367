# SPDX-License-Identifier: Apache-2.0
"""Which parts of a rig's meshes are hair and which are body, however the same parts are divided into meshes."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from neuralocks_core.mesh import rays_through
from neuralocks_core.rig import find_chains
from neuralocks_core.rig.mesh_parts import parted
from neuralocks_core.rig.rigging import HairRig, assemble_rig
from neuralocks_core.skinned_body import Body

from .builders import character, tail

TAILS = [f"hair_{side}" for side in range(6)]
ANGLES = np.linspace(0.6, 2 * np.pi - 0.6, len(TAILS))
WHO = character(
    [row for name, a in zip(TAILS, ANGLES) for row in tail(name, 3, (0.12 * np.sin(a), 1.6, 0.12 * np.cos(a)))]
    + [("ribbon", "head", (0, 1.7, -0.1))]
)
LEAVES = [name.rsplit("/", 1)[-1] for name in WHO.skeleton.names]
CENTRE = WHO.canonical_to_bind[:3, 3] + WHO.head_centre


HORN = trimesh.creation.cone(0.02, 0.25)


def _ball(radius: float, centre, keep=lambda points: np.ones(len(points), bool)):
    ball = trimesh.creation.icosphere(3, radius)
    faces = ball.faces[keep(ball.vertices)[ball.faces].all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    return ball.vertices[used] + centre, faces.reshape(-1, 3)


def _lock(name: str):
    """A strip from the cap down its chain, whose first three rows ride on the head."""
    top = WHO.skeleton.bind[LEAVES.index(f"{name}_1"), :3, 3]
    rows = top + np.linspace([0, 0.06, 0], [0, -0.12, -0.02], 8)
    points = np.concatenate([rows, rows + [0.015, 0, 0.015]])
    first = np.arange(7)
    faces = np.concatenate([np.stack([first, first + 1, first + 8], 1), np.stack([first + 1, first + 9, first + 8], 1)])
    return points, faces, 2 * (["head"] * 3 + [f"{name}_1"] * 3 + [f"{name}_2"] * 2)


def _parts(dense: bool) -> dict:
    """Name -> points, triangles, joint of each point. A dense head has more vertices than all hair."""
    head = _ball(0.1, CENTRE)
    if dense:
        finer = trimesh.Trimesh(*head, process=False).subdivide()
        head = finer.vertices, finer.faces
    chest = trimesh.creation.box((0.3, 0.3, 0.2))
    parts = {
        "torso": (chest.vertices + [0, 1.3, 0], chest.faces, "chest"),
        "head": (*head, "head"),
        "eye": (*_ball(0.012, CENTRE + [0.03, 0.02, 0.09]), "head"),
        "horn": (HORN.vertices[:, [2, 0, 1]] + CENTRE + [0.08, 0.08, 0], HORN.faces, "head"),
        "bow": (0.2 * chest.vertices + CENTRE + [0, 0.1, -0.12], chest.faces, "ribbon"),
        "card": (_lock(TAILS[2])[0] + [0, 0.05, 0.001], _lock(TAILS[2])[1], "head"),
        "fringe": (*_ball(0.105, CENTRE, lambda p: (p[:, 2] > 0.03) & (p[:, 1] > 0.035)), "head"),
        "cap": (*_ball(0.11, CENTRE, lambda p: p[:, 1] - p[:, 2] > 0.02), "head"),
        **{name: _lock(name) for name in TAILS},
    }
    return {k: (p, f, [j] * len(p) if isinstance(j, str) else j) for k, (p, f, j) in parts.items()}


HAIR = ["cap", "fringe", *TAILS]
MOVING = np.array([leaf.startswith("hair") for leaf in LEAVES])
DIVIDED = {
    "hair apart": [["torso", "head", "eye", "horn"], HAIR],
    "head apart": [["torso"], ["head", "eye", "horn"], HAIR],
    "head with hair": [["torso"], ["head", "eye", "horn", *HAIR]],
    "cap with body": [["torso", "cap", "fringe", *TAILS[:1]], ["head", "eye", "horn", *TAILS[1:]]],
    "one mesh": [["torso", "eye", "horn", *HAIR, "head"]],
}


def _mesh(parts: dict, names: list[str]):
    """A mesh of these parts, and which part each vertex is of."""
    points, faces, joints = zip(*(parts[name] for name in names))
    counts = [len(each) for each in points]
    starts = np.cumsum([0, *counts])
    indices = np.array([LEAVES.index(leaf) for each in joints for leaf in each])[:, None]
    faces = np.concatenate([each + start for each, start in zip(faces, starts)])
    return Body(np.concatenate(points), faces, indices, np.ones(indices.shape)), np.repeat(names, counts)


@pytest.mark.parametrize("dense", [False, True])
@pytest.mark.parametrize("name", DIVIDED)
def test_hair_and_body_are_the_same_however_they_are_divided(name, dense):
    parts, counts = _parts(dense), dict.fromkeys(["torso", "head", "eye", "horn", *HAIR], 0)
    meshes, owners = zip(*(_mesh(parts, names) for names in DIVIDED[name]))
    for owner, (triangles, moved) in zip(owners, parted(WHO, meshes, MOVING)):
        assert set(owner[moved]) == set(TAILS) & set(owner)
        for part in owner[triangles[:, 0]]:
            counts[part] += 1
    assert counts == {part: 0 if part in HAIR else len(parts[part][1]) for part in counts}


@pytest.mark.parametrize("last", ["head", "curtain"])
def test_hair_before_the_face_is_hair_in_any_order(last):
    """The roots of a lock that hides the face ride on the head as the skin under them does."""
    points, faces = _ball(0.115, CENTRE, lambda points: points[:, 2] > 0.02)
    joints = np.where(points[:, 1] < CENTRE[1] - 0.09, f"{TAILS[0]}_1", "head")
    parts = _parts(False) | {"curtain": (points, faces, joints.tolist())}
    names = sorted(["torso", "head", "eye", "horn", "cap", "curtain", *TAILS], key=last.__eq__)
    mesh, owner = _mesh(parts, names)
    ((body, _),) = parted(WHO, [mesh], MOVING)
    assert set(owner[body[:, 0]]) == {"torso", "head", "eye", "horn"}


def test_of_a_mesh_of_hair_all_is_hair():
    """With what is worn in it, and cards on the head that nothing moves."""
    parts = _parts(False)
    skin, hair = (_mesh(parts, names)[0] for names in (["torso", "head", "eye", "horn"], [*TAILS, "bow", "card"]))
    (body, _), (own, _) = parted(WHO, [skin, hair], MOVING)
    assert len(body) == len(skin.triangles) and not len(own)


def test_what_shares_a_mesh_with_locks_is_judged_by_itself():
    """A hat covers the crown as a cap of hair does, but is larger; eyes and a horn without skin are more than the lock beside them."""
    hat = _ball(0.2, CENTRE, lambda points: points[:, 1] > 0.02)
    parts = _parts(False) | {"hat": (*hat, ["head"] * len(hat[0]))}
    worn = ["torso", "head", "hat", "cap", *TAILS], ["eye", "horn", TAILS[0]]
    meshes, owners = zip(*(_mesh(parts, names) for names in worn))
    kept = [owner[body[:, 0]] for owner, (body, _) in zip(owners, parted(WHO, meshes, MOVING))]
    assert {part: int((kept[0] == part).sum()) for part in ("hat", "cap")} == {"hat": len(hat[1]), "cap": 0}
    assert set(kept[1]) == {"eye", "horn"} and len(kept[1]) == len(parts["eye"][1]) + len(parts["horn"][1])


def test_weights_that_bleed_decide_nothing():
    """A helmet with a vertex that a hair joint drives a little, and a lock with one that the chest does, as automatic weights give."""
    parts = _parts(False)
    parts["helmet"] = (*_ball(0.13, CENTRE), ["head"] * len(_ball(0.13, CENTRE)[0]))
    names = ["torso", "head", "eye"], [*TAILS, "card"], ["helmet"]
    meshes = [_mesh(parts, each)[0] for each in names]
    bled = []
    for mesh, joint in zip(meshes, ("head", "chest", "hair_0_2")):
        indices = np.hstack([mesh.joint_indices, np.full_like(mesh.joint_indices, LEAVES.index(joint))])
        weights = np.hstack([mesh.joint_weights, np.zeros_like(mesh.joint_weights)])
        weights[-1] = 0.97, 0.03
        bled.append(replace(mesh, joint_indices=indices, joint_weights=weights))
    for mesh, part, (body, _) in zip(bled, names, parted(WHO, bled, MOVING)):
        assert len(body) > len(mesh.triangles) - 9 if "card" not in part else not len(body)


def test_hair_of_several_meshes_is_put_together():
    """Each of its vertices keeps its place, and the joint that drives it; skin between has none of it."""
    parts = _parts(False)
    meshes = [_mesh(parts, names)[0] for names in (TAILS[:2], ["torso", "head"], TAILS[2:])]
    rig = assemble_rig(WHO, meshes)
    moves = [MOVING[mesh.joint_indices[:, 0]] for mesh in meshes]
    wanted = np.concatenate([mesh.points[moved] for mesh, moved in zip(meshes, moves)])
    np.testing.assert_allclose(rig.points, WHO.canonical(wanted))
    driven = [LEAVES[j] for mesh, moved in zip(meshes, moves) for j in mesh.joint_indices[moved, 0]]
    assert [("head", *rig.chains.names)[column] for column in rig.weights.argmax(axis=1)] == driven
    assert set(rig.weights.ravel()) == {0, 1}


def test_hair_without_a_character_is_hair():
    """Of a cap with locks alone, nothing is body."""
    mesh, owner = _mesh(_parts(False), ["cap", *TAILS])
    assert (owner != "cap").mean() > 0.2
    ((triangles, moved),) = parted(WHO, [mesh], MOVING)
    assert moved.any() and not len(triangles)


def test_without_meshes_nothing_is_parted():
    assert parted(WHO, [], MOVING) == []


def test_a_scalp_that_bones_below_a_copy_of_the_head_move_is_closed():
    """In a control rig, the bones of the face may hang from a copy of the head's joint."""
    place = tuple(WHO.skeleton.bind[WHO.head, :3, 3])
    rows = [("copy", "neck", place), ("face", "copy", (0, 1.6, 0.05)), *tail("hair", 3)]
    for joint, closed in (("head", True), ("face", True), ("neck", False)):
        who = character(rows)
        points, faces = _ball(0.12, CENTRE, lambda points: points[:, 1] < 0.1)
        index = [name.rsplit("/", 1)[-1] for name in who.skeleton.names].index(joint)
        body = Body(points, faces, np.full((len(points), 1), index), np.ones((len(points), 1)))
        chains = find_chains(who)
        rig = HairRig(who, chains, np.zeros((0, 3)), np.zeros((0, len(chains) + 1)))
        assert (len(rig.with_body(body).character.body.triangles) > len(faces)) == closed


def test_rays_pass_through_what_lies_ahead():
    points = np.array([[-1, -1, 2], [1, -1, 2], [0, 1, 2], [0, 0, -3], [1, 0, -3], [0, 1, -3.0]])
    ways = np.array([[0, 0, 1.0], [0, 0, -1], [0.2, 0.2, -3], [1, 0, 0]])
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    found = rays_through(points, np.array([[0, 1, 2], [5, 4, 3]]), np.zeros(3), ways)
    assert sorted(zip(*map(np.ndarray.tolist, found[:2]))) == [(0, 0), (2, 1)]
    np.testing.assert_allclose(found[2], [2, 3 / ways[2, 2] * -1])
