# SPDX-License-Identifier: Apache-2.0
"""Whole numbers that a caller gives for an argument."""

import math
from numbers import Integral


def is_whole(given, low: float = -math.inf, high: float = math.inf) -> bool:
    """Whether something is a whole number from `low` to `high`. True and False, which Python counts as 1 and 0, are not."""
    return isinstance(given, Integral) and not isinstance(given, bool) and low <= given <= high
