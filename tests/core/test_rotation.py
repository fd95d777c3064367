# SPDX-License-Identifier: Apache-2.0
"""Matrices, quaternions and vectors of rotations agree; the rotation part of a transform is the nearest one."""

import numpy as np
import pytest

from neuralocks_core import rotation
from neuralocks_core.errors import NeuralocksError


def test_quaternions_and_vectors_agree_with_matrices():
    turns = rotation.from_vector(np.random.default_rng(0).normal(size=(50, 3)) * 2)
    assert np.allclose(rotation.from_quaternion(rotation.to_quaternion(turns)), turns)
    assert np.allclose(rotation.from_vector(rotation.to_vector(turns)), turns)
    a, b = np.random.default_rng(1).normal(size=(2, 50, 3))
    b[:5] = -a[:5]
    turned = np.einsum("nij,nj->ni", rotation.between(a, b), a / np.linalg.norm(a, axis=1, keepdims=True))
    assert np.allclose(turned, b / np.linalg.norm(b, axis=1, keepdims=True))


@pytest.mark.parametrize("axis", np.eye(3))
def test_opposite_directions_are_half_a_turn_apart(axis):
    """About any perpendicular axis; the cross product with a fixed axis vanishes for some."""
    np.testing.assert_allclose(rotation.between(axis, -axis) @ axis, -axis, atol=1e-12)


def test_products_of_quaternions_of_any_length_turn_by_b_and_then_a():
    a, b = np.random.default_rng(0).normal(size=(2, 5, 3, 4))
    product = rotation.quaternion_product(a, b)
    np.testing.assert_allclose(np.linalg.norm(product, axis=-1), 1, atol=1e-12)
    one_by_one = rotation.from_quaternion(a) @ rotation.from_quaternion(b)
    np.testing.assert_allclose(rotation.from_quaternion(product), one_by_one, atol=1e-12)


def test_quaternions_of_a_motion_go_on_from_each_other():
    turns = rotation.from_vector(np.linspace(0, 4 * np.pi, 60)[:, None, None] * [[0.0, 0.6, 0.8], [1.0, 0.0, 0.0]])
    found = rotation.to_quaternion(turns)
    smooth = rotation.continuous(found)
    assert ((found[1:] * found[:-1]).sum(axis=-1) < 0).any() and ((smooth[1:] * smooth[:-1]).sum(axis=-1) > 0.9).all()
    np.testing.assert_array_equal(np.abs(smooth), np.abs(found))


def test_the_angle_between_rotations_is_that_of_the_turn_from_one_to_the_other():
    a, b = rotation.from_vector(np.random.default_rng(0).normal(size=(2, 20, 3)))
    angles = np.linalg.norm(rotation.to_vector(b @ np.swapaxes(a, -1, -2)), axis=-1)
    np.testing.assert_allclose(rotation.angle_between(a, b), angles, atol=1e-7)


def test_what_scales_an_axis_to_nothing_is_flat():
    linear = rotation.from_vector(np.random.default_rng(0).normal(size=(2, 3, 3))) * [1.0, 2.0, 3.0]
    assert not rotation.flat(linear).any() and not rotation.flat(-linear, 0.5).any()
    linear[0, 1, :, 1] = 0
    linear[1, 2] *= 1e-7
    assert np.argwhere(rotation.flat(linear)).tolist() == [[0, 1]]
    assert np.argwhere(rotation.flat(linear, 1e-6)).tolist() == [[0, 1], [1, 2]]


def test_affine_transforms_are_undone_by_their_inverse_and_flat_ones_refused():
    rng = np.random.default_rng(4)
    for size in (1e-3, 1.0, 1e3):
        transform = np.eye(4)
        transform[:3] = rng.normal(size=(3, 4)) * size
        assert np.allclose(rotation.inverse(transform) @ transform, np.eye(4), atol=1e-9)
        assert np.allclose(rotation.inverse(transform), np.linalg.inv(transform), rtol=1e-9)
        several = np.stack([transform, transform[[1, 0, 2, 3]], np.eye(4)])[:, None]
        assert np.allclose(rotation.inverses(several), np.linalg.inv(several), rtol=1e-9)
    transform[:3, 1] = 0
    with pytest.raises(NeuralocksError, match="flat"):
        rotation.inverse(transform)
    transform[1, 1] = np.nan
    with pytest.raises(NeuralocksError, match="not finite"):
        rotation.inverse(transform)


def test_transforms_relative_to_parents_lead_back_to_those_in_the_skeletons_space():
    rng, parents = np.random.default_rng(4), np.array([-1, 0, 1, 1, -1, 4])
    local = np.tile(np.eye(4), (3, 6, 1, 1))
    local[..., :3, :3] = rotation.from_vector(rng.normal(size=(3, 6, 3)))
    local[..., :3, 3] = rng.normal(size=(3, 6, 3))
    kept, world = local.copy(), rotation.from_parents(local, parents)
    np.testing.assert_allclose(world[:, 3], local[:, 0] @ local[:, 1] @ local[:, 3], atol=1e-12)
    np.testing.assert_allclose(rotation.relative_to_parents(world, parents), local, atol=1e-12)
    np.testing.assert_array_equal(local, kept)


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
    np.testing.assert_allclose(rotation.rotation_part(transforms), u @ vt, rtol=0, atol=1e-13)


def test_a_size_is_shown_relative_to_that_of_the_bind_pose():
    """A rig in centimetres, whose head grows in the middle of a shot only."""
    bind = np.diag([100.0, 100.0, 100.0, 1.0])
    posed = np.tile(bind, (60, 1, 1))
    posed[:, :3, 3] = np.arange(60)[:, None]
    assert rotation.sizes_shown(posed, bind) == pytest.approx(1.0)
    posed[15:45, :3, :3] *= 2
    shown = rotation.sizes_shown(posed, bind)
    assert {round(each, 6) for each in shown} == {1.0, 2.0} and 0.4 < np.mean(shown > 1.5) < 0.6
