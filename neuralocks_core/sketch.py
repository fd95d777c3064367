# SPDX-License-Identifier: Apache-2.0
"""A few numbers that tell whether two large sets of values are the same except for rounding.

A hash cannot, since machines round differently. Here a change of any values, by d in the root of the sum of squares, moves
each number by about d / sqrt(n), because the signs are random (Johnson and Lindenstrauss).
"""

from collections.abc import Iterable

import numpy as np

SUMS = 3


def sketch(blocks: Iterable[np.ndarray]) -> str:
    """Text for arrays of any shapes, one after another: number of values, their rms, and sums with pseudorandom signs."""
    chosen, count, square, sums = np.random.PCG64(0), 0, 0.0, np.zeros(SUMS)
    for block in blocks:
        values = np.asarray(block, float).ravel()
        words = chosen.random_raw(len(values))
        count, square = count + len(values), square + float(np.square(values).sum())
        for number in range(SUMS):
            sums[number] += np.where(words >> np.uint64(number + 40) & np.uint64(1), values, -values).sum()
    told = np.array([np.sqrt(square), *sums]) / np.sqrt(max(count, 1))
    return " ".join([str(count), *(f"{number:.9g}" for number in told)])


def alike(one: str, other: str, near: float) -> bool:
    """Whether two sketches are of the same values, except for rounding by `near` of their rms; ValueError if one is no sketch."""
    a, b = (np.array([float(number) for number in text.split()]) for text in (one, other))
    if len(a) != SUMS + 2 or len(b) != SUMS + 2:
        raise ValueError("no sketch")
    return bool(a[0] == b[0] and (np.abs(a - b)[1:] <= near * max(a[1], b[1]) + 1e-30).all())
