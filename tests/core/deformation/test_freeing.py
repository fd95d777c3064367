# SPDX-License-Identifier: Apache-2.0
"""Hair that is put on a head and goes into the body is laid over it; all other hair stays as it is, bit for bit."""

import numpy as np
import pytest
import trimesh

from neuralocks_core.body.collider import Collider
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.deformation.freeing import freed
from neuralocks_core.groom import Groom
from neuralocks_core.skinned_body import Body
from tests.core import rigs

RADIUS = 0.1
BALL = trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)


def standing(size: float, worn: float = 0.0) -> Character:
    """A ball for a head on a larger ball, for a person `size` times as large; `worn` [m] is the thickness of a helmet."""
    place = np.diag([size, size, size, 1.0])
    bind = place @ rigs.bind() @ np.linalg.inv(place)
    middle, count = bind[rigs.HEAD, :3, 3], len(BALL.vertices)
    head, trunk = (1 + worn / RADIUS) * BALL.vertices, 2 * BALL.vertices - [0, 0.28, 0]
    points, faces = size * np.concatenate([head, trunk]) + middle, np.concatenate([BALL.faces, BALL.faces + count])
    joints = np.repeat([[rigs.HEAD], [0]], count, axis=0)
    return Character(Skeleton(rigs.NAMES, rigs.PARENTS, bind), Body(points, faces, joints, np.ones((2 * count, 1))))


def hanging(size: float, vertices: int) -> np.ndarray:
    """Strands (40, vertices, 3) [m] from the sides of the head straight down into the ball below, and above it one that stands up."""
    around, down = np.linspace(0, 2 * np.pi, 39), np.linspace(0, 0.25, vertices)
    roots = RADIUS * np.stack([np.cos(around), 0 * around, np.sin(around)], axis=-1)
    points = roots[:, None] - down[:, None] * [0, 1, 0]
    up = RADIUS * np.array([[[0, 1, 0]]]) + 0.3 * down[:, None] * [0, 1, 0]
    return size * np.concatenate([points, up])


@pytest.mark.parametrize("vertices", [24, 60])
@pytest.mark.parametrize("size", [1.0, 40.0])
def test_hair_that_hangs_into_shoulders_lies_on_them(size, vertices):
    character = standing(size)
    body, own = Collider(character.body.points, character.body.triangles), hanging(size, vertices)
    points = (own + character.skeleton.bind[rigs.HEAD, :3, 3]).astype(np.float32)
    groom = Groom("Hair", points.reshape(-1, 3), np.full(40, vertices))
    laid, moved = freed(groom, character)
    after = laid.points.reshape(points.shape)
    assert body.distance(points[:-1], limit=np.inf)[0].min() < -0.03 * size
    assert body.distance(after[:, 1:], limit=np.inf)[0].min() > -2e-4 * size
    np.testing.assert_array_equal(after[:, 0], points[:, 0])
    np.testing.assert_array_equal(after[-1], points[-1])
    assert moved[-1] == 0 and moved[:-1].min() > 0.02 * size
    length = [np.linalg.norm(np.diff(each.astype(float), axis=1), axis=2).sum(axis=1) for each in (after, points)]
    np.testing.assert_allclose(*length, rtol=1e-4)


def test_hair_under_a_helmet_stays_there():
    character = standing(1.0, worn=0.02)
    points = (hanging(1.0, 24) + character.skeleton.bind[rigs.HEAD, :3, 3]).astype(np.float32)
    groom = Groom("Hair", points.reshape(-1, 3), np.full(40, 24))
    laid, moved = freed(groom, character)
    assert not moved.any() and np.array_equal(laid.points, groom.points)


@pytest.mark.parametrize("rim", [0.0, 0.03])
def test_hair_below_the_rim_of_a_scalp_without_a_neck_stays_there(rim):
    """The nearest face of an open cap has free air on its inner side, too: strands were flung by 3 and 24 cm."""
    whole, taper = standing(1.0), np.linspace(1, 0.8, 24)[None, :, None]
    cap = whole.body.only(BALL.faces[BALL.vertices[BALL.faces, 1].min(axis=1) > rim])
    points, up = hanging(1.0, 24), rim + 0.02
    points[:39] *= np.concatenate([taper, np.ones_like(taper), taper], axis=2)
    points[:39] = points[:39] * [np.sqrt(1 - (up / RADIUS) ** 2), 1, np.sqrt(1 - (up / RADIUS) ** 2)] + [0, up, 0]
    points = (points + whole.skeleton.bind[rigs.HEAD, :3, 3]).astype(np.float32)
    moved = freed(Groom("Hair", points.reshape(-1, 3), np.full(40, 24)), Character(whole.skeleton, cap))[1]
    assert moved.max() < 0.01


def test_a_hat_is_no_obstacle():
    """Hair that goes in under its rim was crumpled between it and the skin."""
    bare, count = standing(1.0), len(BALL.vertices)
    joints = bare.body.joint_indices.copy()
    joints[:count][BALL.vertices[:, 1] < -0.05] = 0  # skin goes on from the head into the neck, a hat does not
    body = Body(bare.body.points, bare.body.triangles, joints, bare.body.joint_weights)
    above = BALL.faces[BALL.vertices[BALL.faces, 1].min(axis=1) > 0.03]
    hat = 1.05 * BALL.vertices + bare.skeleton.bind[rigs.HEAD, :3, 3]
    dressed = Body(
        np.concatenate([body.points, hat]),
        np.concatenate([body.triangles, above + len(body.points)]),
        np.concatenate([joints, np.full((count, 1), rigs.HEAD)]),
        np.ones((len(body.points) + count, 1)),
    )
    own = hanging(1.0, 24)
    own[:39, :, 1] += 0.2 * (own[:39, :1, 1] - own[:39, :, 1]) ** 0.5  # up a little first, under the rim
    points = (own + bare.skeleton.bind[rigs.HEAD, :3, 3]).astype(np.float32)
    groom = Groom("Hair", points.reshape(-1, 3), np.full(40, 24))
    without, with_hat = (freed(groom, Character(bare.skeleton, each))[0].points for each in (body, dressed))
    assert not np.array_equal(without, groom.points)
    np.testing.assert_allclose(with_hat, without, atol=1e-5)
