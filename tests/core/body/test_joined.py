# SPDX-License-Identifier: Apache-2.0
"""Several bodies as one."""

import numpy as np

from neuralocks_core.skinned_body import Body


def _part(seed: int, count: int, influences: int, names: str) -> Body:
    rng = np.random.default_rng(seed)
    weights = rng.random((count, influences))
    return Body(
        rng.normal(size=(count, 3)),
        rng.integers(0, count, (2 * count, 3)),
        rng.integers(0, 3, (count, influences)),
        weights / weights.sum(axis=1, keepdims=True),
        {name: rng.normal(size=(count, 3)) for name in names},
    )


def test_bodies_joined_are_posed_as_each_by_itself():
    """With different numbers of influences, and blend shapes of which some share a name."""
    parts, shown = [_part(0, 9, 4, "ab"), _part(1, 5, 2, "cb"), _part(2, 7, 3, "")], {"a": 0.5, "b": -1.0, "c": 2.0}
    skinning = np.random.default_rng(3).normal(size=(3, 4, 4))

    def posed(body):
        return body.posed(skinning, np.array([shown[name] for name in body.shapes]))

    whole = Body.joined(parts)
    assert list(whole.shapes) == ["a", "b", "c"]
    np.testing.assert_allclose(posed(whole), np.concatenate([posed(part) for part in parts]), atol=1e-12)
    corners = np.concatenate([part.points[part.triangles] for part in parts])
    np.testing.assert_array_equal(whole.points[whole.triangles], corners)
    assert Body.joined([]) is None
