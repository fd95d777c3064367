# SPDX-License-Identifier: Apache-2.0
"""Seen in a mirror, a motion reads as its own mirrored vectors, and hair as that of the other side."""

import numpy as np
import pytest

from neuralocks_core import rotation
from neuralocks_core.boundary.history import BoundarySampler
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.motion import Clip
from neuralocks_core.strands.strand_set import scalp_local
from neuralocks_core.training.data.mirror import POLAR, mirrored_strands, mirrored_vectors

from ..rigs import bind, person, straight_hair

SWAP = [0, 1, 2, 3, 5, 4]
"""Joints of the humanoid, left and right exchanged."""


def waved(rng) -> Clip:
    """Everything moves: the body, its head, chest and arms."""
    times = np.arange(0, 3, 1 / 60)
    joints = np.tile(bind(), (len(times), 1, 1, 1))
    for joint in range(6):
        axis = rng.normal(size=(3, 3))
        swing = sum(a * np.sin((2 + k) * times + joint)[:, None] for k, a in enumerate(axis))
        joints[:, joint, :3, :3] = rotation.from_vector(0.6 * swing)
    joints[:, :, :3, 3] += 0.2 * np.sin(np.outer(times, [3.0, 5.0, 4.0]))[:, None]
    return Clip(times, joints)


@pytest.mark.parametrize(
    "spec", [BoundarySpec(), BoundarySpec(linear="velocity", chest=False), BoundarySpec(linear="none", bins=(1,) * 5)]
)
def test_a_mirrored_motion_reads_as_the_mirrored_vectors(spec):
    clip, character = waved(np.random.default_rng(0)), person()
    flip = np.diag([*POLAR.astype(float), 1.0])
    other = Clip(clip.times, flip @ clip.joints[:, SWAP] @ flip)
    times = np.linspace(1.7, 2.9, 7)
    plain, seen = (BoundarySampler(spec, character, each).vectors(times) for each in (clip, other))
    assert np.abs(plain - seen).max() > 0.5
    np.testing.assert_allclose(mirrored_vectors(spec, plain), seen, atol=2e-5)
    np.testing.assert_array_equal(mirrored_vectors(spec, mirrored_vectors(spec, plain)), plain)


def test_a_mirrored_strand_is_what_the_other_side_would_grow():
    hair = straight_hair(50)
    other = mirrored_strands(hair)
    again = mirrored_strands(other)
    np.testing.assert_array_equal(other.rest, hair.rest * [-1, 1, 1])
    np.testing.assert_allclose(other.uv, hair.uv * [-1, 1] + [1, 0], atol=1e-6)
    np.testing.assert_allclose(scalp_local(other), scalp_local(hair) * [-1, 1, 1], atol=1e-6)
    for name in ("rest", "uv", "root_frame", "head_centre"):
        np.testing.assert_allclose(getattr(again, name), getattr(hair, name), atol=1e-6)
    assert (other.lock == hair.lock).all()
