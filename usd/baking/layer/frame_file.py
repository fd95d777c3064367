# SPDX-License-Identifier: Apache-2.0
"""One finished frame on disk: its points as float32, padded to eight bytes, and a checksum."""

import os
from pathlib import Path

import numpy as np

from neuralocks_core.files import put_in_place

_BLOCK = 1 << 16
"""Words summed at a time: half a megabyte fits in a core's cache."""


def write_frame(path: Path, points: np.ndarray, spare: Path | None = None) -> None:
    """Write points (P, 3) and then give the file its final name; reuses a spare file if one is given. Raises OSError."""
    numbers = np.ascontiguousarray(points, np.float32).reshape(-1)
    even = len(numbers) // 2 * 2
    odd = np.zeros(2 * (len(numbers) - even), np.float32)
    odd[:1] = numbers[even:]
    total = sum(int(part.view(np.uint64).sum()) for part in (numbers[:even], odd))
    part = path.with_suffix(".part")
    if spare is not None:
        os.replace(spare, part)
    with open(part, "wb" if spare is None else "r+b") as file:
        for data in (numbers[:even], odd, _checksum(total)):
            file.write(data.data)
        file.truncate()
    put_in_place(part, path)


def read_rows(path: Path, first: int, into: np.ndarray) -> None:
    """Fill `into`, (n, 3) float32 and contiguous, with points from the `first` on. Raises OSError, or ValueError if too few."""
    with open(path, "rb", buffering=0) as file:
        file.seek(12 * first)
        if file.readinto(into.reshape(-1).data) < into.nbytes:
            raise ValueError("it is cut short")


def has_size(path: Path, points: int) -> bool:
    """Whether a file is as long as a frame with this many points."""
    try:
        return path.stat().st_size == 12 * points + 4 * (points % 2) + 8
    except OSError:
        return False


def is_whole(path: Path) -> bool:
    """Whether a frame is as it was written: a power cut leaves zeros, or half of it."""
    total, last = 0, 0
    try:
        with open(path, "rb") as file:
            while len(words := np.fromfile(file, np.uint64, _BLOCK)):
                total, last = total + int(words.sum()), int(words[-1])
    except OSError:
        return False
    return int(_checksum(total - last)[0]) == last


def _checksum(total: int) -> np.ndarray:
    """(1,) uint64: the sum of the words before it, in a twentieth of a CRC's time; plus one, or all zeros would pass."""
    return np.array([(total + 1) % (1 << 64)], np.uint64)
