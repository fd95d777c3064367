# SPDX-License-Identifier: Apache-2.0
"""What callers give for an argument: a whole number, true or false, an array of numbers."""

import math
from numbers import Integral

import numpy as np

from neuralocks_core.errors import NeuralocksError


def is_whole(given, low: float = -math.inf, high: float = math.inf) -> bool:
    """Whether something is a whole number from `low` to `high`. True and False, which Python counts as 1 and 0, are not."""
    return isinstance(given, Integral) and not isinstance(given, bool) and low <= given <= high


def flag(name: str, given) -> bool:
    """What a caller gives for an argument that is either true or false. Words are refused, for Python counts 'false' as true.

    Raises:
        NeuralocksError: it is neither; the message begins with the argument's name.
    """
    if not isinstance(given, bool | np.bool_):
        raise NeuralocksError(f"{name} {given!r}: must be True or False")
    return bool(given)


def number_array(name: str, given, wanted: str, kind=np.float64) -> np.ndarray:
    """The numbers that are given for an argument, as an array; not copied if they are one of this kind already. What is too large for it
    becomes infinite.

    Args:
        name: of the argument.
        given: an array, or what numpy makes one of.
        wanted: its shape and unit, for the message; the shape itself is not checked.
        kind: of the result, a floating-point type.

    Raises:
        NeuralocksError: these are not numbers, or rows of different lengths.
    """
    try:
        array = np.asarray(given)
    except (ValueError, TypeError, OverflowError):
        array = np.asarray(None)
    if array.dtype == kind:
        return array
    # Numpy would also take None for NaN, and words for the numbers that they state.
    if array.dtype.kind not in "biuf":
        raise NeuralocksError(f"{name}: is not an array of numbers; give {wanted}")
    with np.errstate(over="ignore"):
        return array.astype(kind)
