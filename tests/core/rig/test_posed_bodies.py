# SPDX-License-Identifier: Apache-2.0
"""The posed bodies that hair on bones learns from: how deep it is in them, how near it may come, and what is held of them."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
import trimesh

torch = pytest.importorskip("torch")

from neuralocks_core.rig.rods import RigMaterial
from neuralocks_core.skinned_body import Body
from neuralocks_core.training.rig import poses
from neuralocks_core.training.rig.body import posed_distances, rest_distances
from neuralocks_core.training.rig.energy import RigEnergy
from neuralocks_core.training.rig.poses import PosePool
from tests.core.rig.builders import with_balls


def test_depths_in_the_body_are_those_of_balls():
    """Wherever a point is: a nearest plane, or only a part of the surface, may take outside for inside."""
    rig, radius = with_balls()
    pool = PosePool(rig, 4, np.random.default_rng(0))
    rng = np.random.default_rng(1)
    count = len(pool.body(0)) // 2
    points = rng.uniform(-0.4, 0.4, (4, 4000, 3)).astype(np.float32)
    found = pool.distances(np.arange(4), points)
    for pose in range(4):
        body = pool.body(pose)
        centres = [body[:count].mean(0), body[count:].mean(0)]
        wanted = np.min([np.linalg.norm(points[pose] - c, axis=1) - radius for c in centres], axis=0)
        assert (found[pose][wanted > 1e-3] > 0).all()
        inside = wanted < -1e-3
        assert inside.sum() > 50 and np.abs(found[pose] - wanted)[inside].max() < 2e-3


def test_depths_of_many_poses_take_no_more_memory_than_those_of_a_few(monkeypatch):
    """A report measures thousands of vertices in 1,000 poses: at 4 kB for each of all at once, a training would end killed."""
    monkeypatch.setattr(poses, "cores", lambda: 1)  # when two are at their peaks at once is chance
    pool = PosePool(with_balls()[0], 12, np.random.default_rng(0))
    points = np.random.default_rng(1).uniform(-0.15, 0.15, (12, 500, 3)).astype(np.float32)
    peaks = []
    for count in (3, 12):
        tracemalloc.start()
        pool.distances(np.arange(count), points[:count])
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.5 * peaks[0], peaks


def test_a_fine_body_is_not_held_whole(monkeypatch):
    """The vertices of hundreds of bodies are most of the memory of a training."""
    monkeypatch.setattr(poses, "KEPT", 100)
    pool = PosePool(with_balls(5)[0], 2, np.random.default_rng(1))
    held = sum(value.nbytes for value in vars(pool).values() if isinstance(value, np.ndarray))
    assert held < 0.5 * (2 * pool.body(0).nbytes)


def test_margins_are_those_at_rest_at_most():
    """Hair that rests on the body as modelled is not pushed away, whatever shapes the body may take."""
    rig, radius = with_balls()
    centre = np.array([0, 0.07, 0.02])  # of the head's ball, from the head joint
    points = centre + np.array([[radius + d, 0, 0] for d in (-0.004, 0.003, 0.02)])
    rig = replace(rig, points=points, weights=rig.weights[:3])
    np.testing.assert_allclose(rest_distances(rig, points), [-0.004, 0.003, 0.02], atol=1e-3)
    np.testing.assert_allclose(RigEnergy(rig, RigMaterial()).margins, [-0.004, 0.003, 0.008], atol=1e-3)


def test_joints_without_a_mesh_meet_no_body():
    """Chains that a user names may drive none: they are learned from their bones."""
    rig, _ = with_balls()
    bare = replace(rig, points=np.zeros((0, 3)), weights=rig.weights[:0])
    assert not PosePool(bare, 2, np.random.default_rng(0)).collides
    assert RigEnergy(bare, RigMaterial()).margins.shape == (0,)


def test_hair_that_rests_in_a_hat_is_not_pushed():
    """Also beside the head, whose skin in the hat is nearest and faces it."""
    rig, radius = with_balls()
    head, hat = rig.character.body, trimesh.creation.box((0.3, 0.3, 0.3))
    hat.apply_translation((0, 1.77, 0.02))
    body = Body(
        np.concatenate([head.points, hat.vertices]),
        np.concatenate([head.triangles, hat.faces + len(head.points)]),
        np.concatenate([head.joint_indices, np.repeat(head.joint_indices[:1], len(hat.vertices), axis=0)]),
        np.concatenate([head.joint_weights, np.ones((len(hat.vertices), 1))]),
    )
    points = np.array([[0, 0.07 + radius + 0.01, 0.02]])
    rig = replace(rig, character=replace(rig.character, body=body), points=points, weights=rig.weights[:1])
    assert rest_distances(rig, points)[0] == pytest.approx(-0.13, abs=1e-3)
    assert RigEnergy(rig, RigMaterial()).margins < 0


def test_hair_over_the_faces_of_a_coarse_body_is_not_thrown_off():
    """There the plane of the nearest vertex is centimetres above the surface."""
    rig, _ = with_balls()
    body, ball = rig.character.body, trimesh.creation.icosphere(1, 0.12)
    points = np.concatenate([ball.vertices + (0, 1.62, 0.02), ball.vertices + (0, 1.3, 0)])
    joints = np.repeat([body.joint_indices[0], body.joint_indices[-1]], len(ball.vertices), axis=0)
    body = Body(
        points, np.concatenate([ball.faces, ball.faces + len(ball.vertices)]), joints, np.ones_like(joints, float)
    )
    rig = replace(rig, character=replace(rig.character, body=body))
    over = ball.triangles_center + 0.004 * ball.face_normals + [0, 0.07, 0.02]
    rig = replace(rig, points=over, weights=np.eye(1, len(rig.chains) + 1).repeat(len(over), 0))
    assert (np.abs(rest_distances(rig, over) - 0.004) < 1e-3).all()
    pool = PosePool(rig, 4, np.random.default_rng(0))
    rest = torch.zeros(4, len(rig.chains), 4)
    rest[..., 0] = 1
    poses = np.arange(4)
    collision = RigEnergy(rig, RigMaterial()).parts(pool, poses, rest, pool.gravity(poses))[1]
    assert collision.max() < 0.1, collision


def test_depths_in_motion_are_those_of_the_bind_pose_there():
    """Wherever the character stands: canonical points keep their distance."""
    rig, radius = with_balls()
    points = np.array([0, 0.07, 0.02]) + np.array([[radius + d, 0, 0] for d in (-0.004, 0.003, 0.02)])
    rig = replace(rig, points=points, weights=rig.weights[:3])
    moved = np.eye(4)
    moved[:3, :3], moved[:3, 3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], (3, 1, -2)
    joints = np.stack([rig.character.skeleton.bind, moved @ rig.character.skeleton.bind])
    found = posed_distances(rig, joints, np.stack([points, points]))
    np.testing.assert_allclose(found, [rest_distances(rig, points)] * 2, atol=1e-5)


def test_renewed_poses_take_the_place_of_the_oldest():
    """And the others stay."""
    rig, _ = with_balls()
    pool = PosePool(rig, 8, np.random.default_rng(0))
    before = pool.relative.copy()
    for changed in ([0, 1, 2], [3, 4, 5], [6, 7, 0]):
        kept = np.setdiff1d(np.arange(8), changed)
        pool.renew(3)
        same = (pool.relative == before).all(axis=(1, 2, 3))
        assert same[kept].all() and not same[changed].any()
        before = pool.relative.copy()
