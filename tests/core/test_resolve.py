# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
import trimesh

from neuralocks_core.collider import Collider
from neuralocks_core.resolve import MARGIN, resolve

HEAD = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
COLLIDER = Collider(HEAD.vertices, HEAD.faces)


def strands(count=60, turn=1.5, seed=0):
    """Strands that leave a sphere and turn back into it; `turn` is their last direction's angle to the first in pi."""
    rng = np.random.default_rng(seed)
    out = rng.normal(size=(count, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    side = np.cross(out, rng.normal(size=(count, 3)))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    angle = np.linspace(0, turn * np.pi, 23)[None, :, None]
    edges = 0.012 * (np.cos(angle) * out[:, None] + np.sin(angle) * side[:, None])
    root = 0.1005 * out
    return np.concatenate([root[:, None], root[:, None] + np.cumsum(edges, axis=1)], axis=1).astype(np.float32)


FREE = np.full((60, 24), 0.01)


def test_no_vertex_stays_inside_and_lengths_are_kept():
    before = strands()
    assert (COLLIDER.distance(before)[0] < 0).mean() > 0.05
    after = resolve(before, COLLIDER, FREE)
    assert COLLIDER.distance(after)[0][:, 2:].min() > 0.5 * MARGIN
    lengths = np.linalg.norm(np.diff(before, axis=1), axis=2)
    np.testing.assert_allclose(np.linalg.norm(np.diff(after, axis=1), axis=2), lengths, atol=2e-7)
    np.testing.assert_array_equal(after[:, :2], before[:, :2])


def test_strands_do_not_depend_on_each_other():
    before = strands()
    whole = resolve(before, COLLIDER, FREE)
    order = np.random.default_rng(1).permutation(60)
    np.testing.assert_array_equal(resolve(before[order], COLLIDER, FREE)[np.argsort(order)], whole)
    np.testing.assert_array_equal(resolve(before[20:33], COLLIDER, FREE[20:33]), whole[20:33])


def test_hair_clear_of_the_body_is_untouched():
    before = strands(turn=0.0) * np.float32(1.5)
    assert resolve(before, COLLIDER, FREE) is before


def test_hair_that_rests_inside_is_not_pushed_beyond_its_rest():
    before = strands()
    rest_distance = np.minimum(COLLIDER.distance(before)[0], 0.01)
    np.testing.assert_array_equal(resolve(before, COLLIDER, rest_distance), before)


@pytest.mark.parametrize("shift", [0.0005, 0.002, 0.01])
def test_small_violations_make_small_corrections(shift):
    """What is pushed moves by about as much as it was deep: no popping."""
    before = strands(turn=0.0)
    lowered = before.copy()
    lowered[:, 2:] -= np.float32(shift) * before[:, 2:] / np.linalg.norm(before[:, 2:], axis=2, keepdims=True)
    after = resolve(lowered, COLLIDER, FREE)
    assert np.abs(after - lowered).max() < 4 * (shift + MARGIN)
