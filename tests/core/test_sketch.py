# SPDX-License-Identifier: Apache-2.0
"""Sketches tell small changes from rounding."""

import numpy as np
import pytest

from neuralocks_core.sketch import alike, sketch


def test_a_small_part_that_changed_is_seen_and_rounding_is_not():
    values = np.random.default_rng(0).normal(size=(40_000, 3))
    own = sketch([values])
    assert own == sketch([values[:7], values[7:]])
    assert alike(own, sketch([values * (1 + 1e-12)]), 1e-9)
    moved = values.copy()
    moved[500:510] += 0.1
    assert not alike(own, sketch([moved]), 1e-4)
    assert not alike(own, sketch([values[:-1]]), 1e-4)
    assert not alike(own, sketch([np.roll(values, 1, axis=0)]), 1e-4), "the order counts"


def test_what_is_no_sketch_is_told():
    own = sketch([np.ones(3)])
    for other in ("", "3 1 1", "a b c d e"):
        with pytest.raises(ValueError):
            alike(own, other, 1e-4)
    assert alike(sketch([]), sketch([]), 1e-4)
