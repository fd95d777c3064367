"""Clips hold samples exactly, blend between them, and refuse what is broken."""

import numpy as np
import pytest

from neuralocks_core import rotation
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import Clip
from tests.core.rigs import HEAD, bind, moved


def test_samples_come_back_bit_for_bit_and_halfway_is_halfway():
    def turn(t):
        return rotation.from_vector(np.stack([0 * t, t, 0 * t], axis=-1))

    clip = moved([0.0, 0.1, 0.3], lambda t: np.stack([t, 0 * t, 0 * t], axis=-1), turn)
    assert np.array_equal(clip.at(clip.times), clip.joints)
    half = clip.at([0.2])[0, HEAD]
    assert half[0, 3] == pytest.approx(0.2)
    assert rotation.to_vector(half[:3, :3])[1] == pytest.approx(0.2)
    assert np.array_equal(clip.at([-5.0])[0], clip.joints[0])
    assert np.array_equal(clip.at([9.0])[0], clip.joints[-1])


def test_a_loop_goes_on():
    clip = moved([0.0, 1.0, 2.0], lambda t: np.stack([np.sin(np.pi * t), 0 * t, 0 * t], axis=-1), loop=True)
    assert np.allclose(clip.at([0.4]), clip.at([4.4]))
    assert np.allclose(clip.at([0.4]), clip.at([-1.6]))


@pytest.mark.parametrize(
    ("times", "change", "fact"),
    [([], None, "no samples"), ([0.0, 0.0], None, "ascend"), ([0.0, 1.0], np.nan, "NaN")],
)
def test_bad_clips_are_refused(times, change, fact):
    joints = np.tile(bind(), (len(times), 1, 1, 1))
    if change is not None:
        joints[1, 0, 0, 0] = change
    with pytest.raises(NeuralocksError, match=fact):
        Clip(times, joints)


def test_quaternions_and_vectors_agree_with_matrices():
    turns = rotation.from_vector(np.random.default_rng(0).normal(size=(50, 3)) * 2)
    assert np.allclose(rotation.from_quaternion(rotation.to_quaternion(turns)), turns)
    assert np.allclose(rotation.from_vector(rotation.to_vector(turns)), turns)
    a, b = np.random.default_rng(1).normal(size=(2, 50, 3))
    b[:5] = -a[:5]
    turned = np.einsum("nij,nj->ni", rotation.between(a, b), a / np.linalg.norm(a, axis=1, keepdims=True))
    assert np.allclose(turned, b / np.linalg.norm(b, axis=1, keepdims=True))


def test_mirrored_and_flat_transforms_are_refused():
    with pytest.raises(NeuralocksError, match="mirrored"):
        rotation.rotation_part(np.diag([-1.0, 1, 1, 1]), "joint")
    with pytest.raises(NeuralocksError, match="zero scale"):
        rotation.rotation_part(np.diag([0.0, 1, 1, 1]), "joint")
    assert np.allclose(rotation.rotation_part(np.diag([2.0, 3, 1, 1])), np.eye(3))


@pytest.mark.parametrize("noise", [0, 1e-7, 2e-5, 1e-3, 0.1])
def test_the_nearest_rotation(noise):
    """The polar factor of the columns brought to unit length, by whichever way it is found."""
    rng = np.random.default_rng(0)
    linear = rotation.from_vector(rng.normal(size=(200, 3))) + rng.normal(0, noise, (200, 3, 3))
    transforms = np.tile(np.eye(4), (200, 1, 1))
    transforms[:, :3, :3] = linear * rng.uniform(0.5, 2, (200, 1, 3))
    u, _, vt = np.linalg.svd(linear / np.linalg.norm(linear, axis=1, keepdims=True))
    np.testing.assert_allclose(rotation.rotation_part(transforms), u @ vt, atol=1e-13)
