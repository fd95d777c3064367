# SPDX-License-Identifier: Apache-2.0
"""A skeleton refuses what no bind pose can be, and says why."""

import numpy as np
import pytest

from neuralocks_core.character import Skeleton
from neuralocks_core.errors import NeuralocksError

BIND = np.tile(np.eye(4), (2, 1, 1))


@pytest.mark.parametrize(
    ("names", "parents", "bind", "fact"),
    [
        ((), [], np.zeros((0, 4, 4)), "no joints"),
        (("a", "a"), [-1, 0], BIND, "same path"),
        (("a", "b"), [1, -1], BIND, "before its parent"),
        (("a", "b"), [-1, 0.5], BIND, "not a whole number"),
        (("a", "b"), [-1, 0], BIND[:1], "needs 2 finite bind transforms"),
        (("a", "b"), [-1, 0], np.full((2, 4, 4), np.nan), "needs 2 finite bind transforms"),
        (("a", "b"), [-1, 0], BIND * [[[1]], [[0]]], "zero scale"),
    ],
)
def test_bad_skeletons_are_refused(names, parents, bind, fact):
    with pytest.raises(NeuralocksError, match=f"^skeleton: .*{fact}.*; "):
        Skeleton(names, parents, bind)
