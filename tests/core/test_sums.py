# SPDX-License-Identifier: Apache-2.0
"""Sums that compiled code is to give bit for bit."""

import numpy as np
import pytest

from neuralocks_core.sums import dot, dot_apart


@pytest.mark.parametrize("count", [0, 1, 1001])
@pytest.mark.parametrize("kinds", [("f4", "f4"), ("f4", "f8"), ("f8", "f8")])
def test_products_of_vectors_are_the_same_however_their_components_lie(kinds, count):
    rng = np.random.default_rng(0)
    a, b = (rng.normal(size=(3, count)).astype(kind) for kind in kinds)
    apart, together = dot_apart(a, b), dot(a.T, b.T)
    assert apart.dtype == together.dtype and apart.tobytes() == together.tobytes()
