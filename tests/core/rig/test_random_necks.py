# SPDX-License-Identifier: Apache-2.0
"""The poses that networks of hair on bones learn from: what necks and arms can do, whichever way a character faces."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("torch")

from neuralocks_core.character import Character, Skeleton
from neuralocks_core.motion import Clip
from neuralocks_core.rig import RigSampler, find_chains, rig_spec
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.rotation import from_vector
from neuralocks_core.training.rig.body import BodyPatch
from neuralocks_core.training.rig.poses import RANGE, Moments, PosePool, _random_skinning
from tests.core.rig.builders import character, tail, with_balls


@pytest.fixture(scope="module", params=[0.0, 2.0], ids=["+Z", "aside"])
def rig(request) -> HairRig:
    """A tail on joints of any orient, of a character that faces any way, with arms that slope."""
    whole = np.eye(4)
    whole[:3, :3] = from_vector(np.array([0, request.param, 0]))
    made = character(tail(), from_vector(np.array([0.3, -1.0, 0.6]))).skeleton
    bind = made.bind.copy()
    bind[[name.endswith("lower_arm") for name in made.names], 1, 3] -= 0.1
    who = Character(Skeleton(made.names, made.parents, whole @ bind))
    chains = find_chains(who)
    return HairRig(who, chains, np.zeros((0, 3)), np.zeros((0, 1 + len(chains))))


def joint(rig: HairRig, name: str) -> int:
    return [path.rsplit("/", 1)[-1] for path in rig.character.skeleton.names].index(name)


def test_poses_are_read_as_in_a_clip(rig):
    skinning = _random_skinning(rig.character, 20, np.random.default_rng(0))
    pool = PosePool(rig, 20, np.random.default_rng(1), Moments(np.zeros((20, 15), np.float32), skinning))
    rows, head = np.arange(20), skinning[pool.moment, rig.character.head, :3, :3]
    down = np.einsum("ij,nkj,k->ni", rig.character.facing, head, [0.0, -1.0, 0.0])
    posed = skinning[pool.moment] @ rig.character.skeleton.bind
    once = np.zeros(1)
    read = [RigSampler(rig_spec(), rig.character, Clip(once, pose[None])).features(once)[0] for pose in posed]
    assert len(set(pool.moment)) > 5
    np.testing.assert_allclose(pool.features(rig_spec(), rows, down), read, atol=1e-6)


def test_necks_do_what_necks_can_and_arms_hang(rig):
    skinning = _random_skinning(rig.character, 2000, np.random.default_rng(0))
    skeleton, facing = rig.character.skeleton, rig.character.facing
    for child, parent in enumerate(skeleton.parents):
        if parent >= 0:  # joints stay where they are on their parents
            pivot = skeleton.bind[child, :, 3]
            np.testing.assert_allclose(skinning[:, child] @ pivot, skinning[:, parent] @ pivot, atol=1e-9)
    assert not np.ptp(skinning[:, joint(rig, "chest")], axis=0).any()
    nods, necks = (
        np.degrees(np.abs(Rotation.from_matrix(facing @ skinning[:, row, :3, :3] @ facing.T).as_rotvec())).max(axis=0)
        for row in (rig.character.head, joint(rig, "neck"))
    )
    assert nods == pytest.approx([64, 86, 48], abs=6) and (necks < 0.75 * nods).all() and (necks > 0.4 * nods).all()
    turns = Rotation.from_matrix(facing @ skinning[:, rig.character.head, :3, :3] @ facing.T).as_rotvec()
    far = np.linalg.norm(turns / RANGE, axis=1) / 1.1  # evenly in an ellipsoid
    assert np.percentile(far, [20, 50, 80]) == pytest.approx(np.cbrt([0.2, 0.5, 0.8]), abs=0.04)
    for side, sign in (("left", 1), ("right", -1)):
        elbow, shoulder = (skeleton.bind[joint(rig, f"{side}_{part}_arm"), :, 3] for part in ("lower", "upper"))
        arm = (skinning[:, joint(rig, f"{side}_upper_arm")] @ (elbow - shoulder))[:, :3] @ facing.T
        below = np.degrees(np.arctan2(-arm[:, 1], sign * arm[:, 0]))
        assert below.min() == pytest.approx(15, abs=1) and below.max() == pytest.approx(80, abs=1)


def test_the_trunk_leans_and_seldom_lies(rig):
    """Gravity is drawn in the axes of the upper chest, however the head is turned on it."""
    pool = PosePool(rig, 2000, np.random.default_rng(0))
    trunk = np.einsum("nji,nj->ni", pool.relative[:, 1], pool.gravity(np.arange(2000)))
    lean = np.degrees(np.arccos(np.clip(-trunk[:, 1], -1, 1)))
    assert np.median(lean) == pytest.approx(18, abs=3) and 0.02 < (lean > 90).mean() < 0.06
    assert np.abs(trunk[:, [0, 2]].mean(axis=0)).max() < 0.03


def test_bodies_have_shapes_and_hair_meets_them():
    """Of the chest, since hair was fitted to its head."""
    rig, _ = with_balls()
    body = rig.character.body
    below = body.joint_indices[:, 0] != rig.character.head
    pools = []
    for size in (0.0, 0.05):
        wide = replace(body, shapes={"wide": np.where(below[:, None], [0, 0, size], 0.0)})
        pools.append(PosePool(replace(rig, character=replace(rig.character, body=wide)), 4, np.random.default_rng(0)))
    plain, shaped = (np.stack([pool.body(pose) for pose in range(4)]) for pool in pools)
    moved = np.linalg.norm(shaped - plain, axis=2)
    chest = moved.max(axis=0) > 0
    np.testing.assert_allclose(
        moved[:, chest], np.broadcast_to(0.05 * np.abs(pools[1].shapes), (4, chest.sum())), atol=1e-6
    )
    assert 0 < chest.sum() < len(chest) and np.ptp(pools[1].shapes) > 0.2
    normals, offsets = pools[1].planes(np.arange(4), shaped)
    assert np.abs(np.einsum("nvi,nvi->nv", normals, shaped) - offsets).max() < 1e-3


def test_other_bodies_vary_the_less_the_more_a_place_follows_the_head():
    """As on a neck; and relative to the head, which a shape may move as a whole."""
    rig, _ = with_balls()
    body, head = rig.character.body, rig.character.head
    on_head = np.where(body.joint_indices[:, 0] == head, 1.0, 0.25)
    weights = np.stack([on_head, 1 - on_head], axis=1)
    joints = np.tile([head, body.joint_indices[-1, 0]], (len(weights), 1))
    shape = np.where(on_head[:, None] == 1, [0.01, 0, 0], [0, 0, 0.05])
    body = replace(body, joint_indices=joints, joint_weights=weights, shapes={"wide": shape})
    patch = BodyPatch.of(replace(rig, character=replace(rig.character, body=body)), 100)
    moved = np.unique(patch.body.shapes["wide"].round(9), axis=0)
    np.testing.assert_allclose(moved, [[-0.0075, 0, 0.0375], [0, 0, 0]], atol=1e-9)
