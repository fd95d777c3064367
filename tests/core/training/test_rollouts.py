# SPDX-License-Identifier: Apache-2.0
"""Hair on bodies of other shapes, and which bodies a training has seen."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

pytest.importorskip("torch", reason="the extra 'train' is not installed")

from neuralocks_core import rotation
from neuralocks_core.animation.random_motion import scripted_clip
from neuralocks_core.character import Character
from neuralocks_core.materials import NO_PLANE, RANGES, UNREAD, at_weight_one
from neuralocks_core.measures import HIGHEST, LOWEST, MEASURES, body_measures
from neuralocks_core.reference.solver import SimulatedHair
from neuralocks_core.skinned_body import Body
from neuralocks_core.strands.locks import lock_mates
from neuralocks_core.training.data.rollouts import PREROLL, SHAPES, RolloutMaker, TrainingScene, learned_measures
from tests.core.rigs import HEAD, bind, person, straight_hair

RADIUS = 0.09
BALL = trimesh.creation.icosphere(4, RADIUS)


def headed(turn=None):
    """A ball as the head of a humanoid that is turned as a whole; shapes make the ball larger, and move it forward."""
    turn = np.eye(3) if turn is None else turn
    points, count = (BALL.vertices + bind()[HEAD, :3, 3]) @ turn.T, len(BALL.vertices)
    shapes = {"large": 0.4 * BALL.vertices @ turn.T, "forward": np.tile(turn[:, 2] * 0.1, (count, 1))}
    body = Body(points, BALL.faces, np.full((count, 1), HEAD), np.ones((count, 1)), shapes)
    return Character(person(turn).skeleton, body)


@pytest.mark.parametrize("yaw", [0.0, 1.2])
def test_roots_follow_the_scalp_hair_on_it_the_scalp_below_and_free_hair_its_root(yaw):
    maker = RolloutMaker(TrainingScene(headed(rotation.from_vector([0, yaw, 0])), (straight_hair(),)))
    angle, away = np.linspace(0.2, 1.5, 24), RADIUS + np.linspace(0, 2, 24)[:, None]
    lying = RADIUS * np.stack([0 * angle, np.cos(angle), np.sin(angle)], axis=1)
    rest = np.stack([lying, away * lying[0] / RADIUS])
    assert maker.fitted(rest, np.zeros(2)) is rest
    larger = maker.fitted(rest, np.array([0.5, 0.0]))
    np.testing.assert_allclose(larger[0], 1.2 * lying, atol=2e-3)
    np.testing.assert_allclose(larger[1, 0], 1.2 * lying[0], atol=2e-3)
    np.testing.assert_allclose(larger[1, -1] - rest[1, -1], larger[1, 0] - rest[1, 0], atol=1e-9)
    both = maker.fitted(rest, np.array([0.5, 0.3]))
    np.testing.assert_allclose(both - larger, np.broadcast_to([0, 0, 0.03], rest.shape), atol=1e-9)


def test_half_of_the_bodies_have_other_shapes_and_a_third_moves_as_given():
    given = scripted_clip(headed(), "nod", 4.0)
    maker = RolloutMaker(TrainingScene(headed(), (straight_hair(),), (given,), frames=PREROLL + 2))
    draws = [maker.draw(index) for index in range(60)]
    assert 11 <= sum(draw.first == PREROLL for draw in draws) <= 31
    shapes = np.array([draw.shape for draw in draws])
    other = shapes.any(axis=1)
    assert shapes.shape == (60, 2) and 18 <= other.sum() <= 42
    for low, high in zip(shapes[other].min(axis=0), shapes[other].max(axis=0)):
        assert -SHAPES <= low < -0.6 * SHAPES and 0.6 * SHAPES < high <= SHAPES


def test_the_body_reaches_below_the_longest_hair_of_all_grooms(monkeypatch):
    reaches, short = [], straight_hair()
    long = replace(short, rest=short.rest * np.float32([1, 3, 1]))
    monkeypatch.setattr("neuralocks_core.training.data.rollouts.hair_body", lambda who, reach: reaches.append(reach))
    for grooms in ((short, long), (long, short)):
        RolloutMaker(TrainingScene(headed(), grooms))
    assert reaches == pytest.approx([0.2 - float(long.rest[..., 1].min())] * 2) and reaches[0] > 0.5


def test_of_a_large_lock_those_around_one_strand_are_drawn():
    """Far from each other, they would not be tied together as they are in the whole lock."""
    hair = straight_hair()
    whole = replace(hair, lock=np.zeros_like(hair.lock))
    maker = RolloutMaker(TrainingScene(person(), (whole,), strands=8))
    for drawn in (maker.draw(index).strands for index in range(5)):
        away = np.linalg.norm(hair.rest[:, 0] - hair.rest[drawn, None, 0], axis=-1)
        assert sorted(drawn) in np.sort(away.argsort(axis=1)[:, :8], axis=1).tolist()


def test_the_solver_is_given_what_was_drawn_and_its_answer_is_kept(monkeypatch):
    """The body in its shape, in the bind pose and in motion; each lock's own material; planes as seen from the rest vertex."""
    scene = TrainingScene(headed(), (straight_hair(),), frames=12, strands=40)
    maker, given = RolloutMaker(scene), {}
    index = next(i for i in range(20) if maker.draw(i).shape.any())
    draw, hair, way = maker.draw(index), scene.grooms[0], np.random.default_rng(0).normal(0, 0.05, (12, 40, 24, 3))

    def simulate(rest, head, body, triangles, materials, **others):
        given.update(others, rest=rest, head=head, body=body, triangles=triangles, materials=materials)
        planes = np.tile(np.float32([0.0, 0.6, 0.8, 0.05]), (*way.shape[:-1], 1))
        planes[:, 0] = NO_PLANE
        return SimulatedHair((rest + way).astype(np.float32), planes, np.arange(12.0) ** 2, np.ones(12))

    monkeypatch.setattr("neuralocks_core.reference.simulate", simulate)
    rollout = maker.make(index)
    large, forward = draw.shape
    own = np.linalg.inv(given["head"])
    posed = np.einsum("tij,tvj->tvi", own[:, :3, :3], given["body"]) + own[:, None, :3, 3]
    for ball in (given["bind_body"], *posed):  # in canonical space
        away = np.linalg.norm(ball - [0, 0, 0.1 * forward], axis=1)
        np.testing.assert_allclose(away, RADIUS * (1 + 0.4 * large), atol=1e-4)
        assert given["triangles"].max() == len(ball) - 1
    assert np.array_equal(given["rest"], maker.fitted(hair.rest[draw.strands].astype(float), draw.shape))
    assert np.array_equal(given["neighbours"], lock_mates(given["rest"], hair.lock[draw.strands]))
    assert (given["neighbours"] >= 0).any() and given["dt"] == scene.spec.dt and given["planes"] is True
    for name in RANGES:
        own = np.array([getattr(material, name) for material in draw.materials])
        assert np.array_equal(given["materials"][name], own)
        assert (len(np.unique(own)) == 1) == (name == "weight"), "one motion covers many materials of one weight"
    for lock in np.unique(hair.lock[draw.strands]):
        assert len({draw.materials[i] for i in np.flatnonzero(hair.lock[draw.strands] == lock)}) == 1
    np.testing.assert_allclose(rollout.moved * rollout.step, way, atol=rollout.step)
    np.testing.assert_allclose(rollout.rest, given["rest"], atol=1e-7)
    near, far = rollout.planes[:, 1:], rollout.planes[:, 0]
    np.testing.assert_allclose(near[..., :3], np.broadcast_to([0.0, 0.6, 0.8], near[..., :3].shape), atol=1e-3)
    np.testing.assert_allclose(near[..., 3], np.tile(0.05 - given["rest"][1:] @ [0.0, 0.6, 0.8], (12, 1, 1)), atol=1e-3)
    assert (far[..., 3] < -900).all() and rollout.residual == 30.5
    told = at_weight_one([material.log_ratios() for material in draw.materials])[0]
    np.testing.assert_allclose(rollout.materials, told, atol=1e-6)
    parts = scene.spec.slices
    for vectors in (rollout.vectors, rollout.bind):
        lengths = np.clip(body_measures(scene.character, draw.shape), LOWEST, HIGHEST)
        assert np.abs(vectors[..., parts["shape"]] - lengths).max() < 1e-6
        told = vectors[..., parts["material"]] - rollout.materials[0]
        assert np.abs(np.delete(told, UNREAD, axis=-1)).max() < 1e-6


def test_a_training_has_seen_the_bodies_between_the_extremes_of_each_shape():
    """The forward shape reaches farther to the front; both together go beyond what each does."""
    character = headed()
    seen = dict(zip(MEASURES, learned_measures(character).T))
    front, width = seen["head front"], seen["head half width"]
    still = dict(zip(MEASURES, body_measures(character)))
    assert front[0] < still["head front"] - SHAPES * 0.1 + 1e-9 and front[1] > still["head front"] + SHAPES * 0.1 - 1e-9
    large = np.array([-1, 1]) * SHAPES * 0.4
    assert width == pytest.approx(still["head half width"] * (1 + large), rel=1e-6)
    for shape in np.random.default_rng(1).uniform(-SHAPES, SHAPES, (20, 2)):
        assert abs(body_measures(character, shape)[2] - np.mean(front)) < 1.02 * np.ptp(front) / 2


@pytest.mark.parametrize("stretch", [[1.2, 1.2, 1.2], [1.25, 0.8, 1.0]])
def test_hair_learns_from_a_head_that_the_animation_scales_as_from_one_of_constant_size(stretch):
    """The training ended in an error, or, where the volume stayed, the hair was pushed by a squashed head."""
    clip = scripted_clip(headed(), "nod", 8.0)
    joints = clip.joints.copy()
    joints[80:, HEAD, :3, :3] *= stretch
    rollouts = [
        RolloutMaker(TrainingScene(headed(), (straight_hair(),), (each,), frames=60, strands=8)).make(0)
        for each in (clip, replace(clip, joints=joints))
    ]
    assert np.abs(np.diff([each.moved * each.step for each in rollouts], axis=0)).max() < 1e-3
