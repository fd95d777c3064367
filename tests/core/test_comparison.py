# SPDX-License-Identifier: Apache-2.0
"""What hair is compared with: the same simulation, however the body came by its form."""

import numpy as np
import pytest
import trimesh

from neuralocks_core.character import Body, Character, Skeleton
from neuralocks_core.comparison import simulated
from neuralocks_core.groom import Groom
from neuralocks_core.motion import Clip
from neuralocks_core.strands import strand_set

from . import rigs

pytest.importorskip("warp", reason="the extra 'train' is not installed")

HEAD = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
CENTRE = np.array([0.0, 1.68, 0.0])


def person(points, shapes):
    count = len(points)
    body = Body(points, HEAD.faces, np.full((count, 1), rigs.HEAD), np.ones((count, 1)), shapes)
    return Character(Skeleton(rigs.NAMES, rigs.PARENTS, rigs.bind()), body)


def test_a_body_shaped_by_a_blend_shape_is_simulated_as_one_modelled_so():
    swollen = HEAD.vertices * 1.2 + CENTRE
    shaped = person(HEAD.vertices + CENTRE, {"heavy": swollen - HEAD.vertices - CENTRE})
    modelled = person(swollen, {})
    # Strands that lie over the head within the part of it that the shape adds.
    turn, down = np.linspace(0, 2 * np.pi, 8, endpoint=False)[:, None], np.linspace(0.2, 2.0, 12)
    way = np.stack([np.cos(turn) * np.sin(down), np.ones((8, 1)) * np.cos(down), np.sin(turn) * np.sin(down)], axis=-1)
    points = CENTRE + 0.112 * way
    groom = Groom("hair", points.reshape(-1, 3).astype(np.float32), np.full(8, 12))
    times = np.arange(10) / 30
    joints = np.tile(rigs.bind(), (10, 1, 1, 1))
    joints[:, :, 0, 3] += 0.3 * times[:, None] ** 2
    answers = []
    for character, clip in ((shaped, Clip(times, joints, np.ones((10, 1)))), (modelled, Clip(times, joints))):
        strands = strand_set(groom, rigs.POSITIONS[rigs.HEAD], CENTRE - rigs.POSITIONS[rigs.HEAD], character.facing)
        answers.append(simulated(character, strands, clip, times))
    assert np.abs(answers[1]).max() > 1e-3
    np.testing.assert_allclose(answers[0], answers[1], atol=1e-5)
