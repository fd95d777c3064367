# SPDX-License-Identifier: Apache-2.0
"""Numbers that a caller gives for an argument, checked before anything is read."""

import math
from numbers import Integral, Real

from neuralocks_core.errors import NeuralocksError


def check_number(option: str, value, low: float, high: float = math.inf, *, whole: bool = False) -> None:
    """Refuse what is not a number, or not within a range.

    Args:
        option: its name, such as `--strength`.
        value: as given.
        low, high: least and largest.
        whole: whether it must be a whole number.

    Raises:
        NeuralocksError: names the option and the range.
    """
    known = isinstance(value, Integral if whole else Real) and not isinstance(value, bool)
    if not (known and low <= value <= high):
        kind, end = "a whole number" if whole else "a number", f" to {high:g}" if high < math.inf else " on"
        raise NeuralocksError(f"{option} {value!r}: must be {kind} from {low:g}{end}")
