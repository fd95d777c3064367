# SPDX-License-Identifier: Apache-2.0
"""Arrays of numbers that a caller gives for an argument."""

import numpy as np

from neuralocks_core.errors import NeuralocksError


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
