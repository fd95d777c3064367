# SPDX-License-Identifier: Apache-2.0
"""What a groom file holds, before units and axes are settled."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from neuralocks_core.errors import NeuralocksError


@dataclass(frozen=True, eq=False)
class RawGroom:
    """Arrays as in the file; `reading.read` converts and checks them."""

    points: np.ndarray
    """(P, 3) in the file's units and axes."""
    counts: np.ndarray
    """(S,) vertices of each strand."""
    widths: np.ndarray | None = None
    """(P,), (S,) or (1,) in the file's units, or None."""
    root_uv: np.ndarray | None = None
    """(S, 2) or None."""
    color: np.ndarray | None = None
    """(P, 3), or (1, 3) for all, from 0 to 1, or None."""
    transparency: np.ndarray | None = None
    """(P,), or (1,) for all, from 0 to 1, or None."""
    unit: float | None = None
    """Metres per unit, if the format prescribes it."""
    up: str = "Y"
    """The upward axis usual for the format."""
    notes: list[str] = field(default_factory=list)
    """One line for each thing assumed or left out."""


def bad_file(subject: str, fact: str, remedy: str = "export it again") -> NeuralocksError:
    """The error for a file whose content cannot be right."""
    return NeuralocksError(f"{subject}: {fact}; {remedy}")


def big_endian(subject: str) -> NeuralocksError:
    """The error for a file whose numbers have the other byte order."""
    return bad_file(subject, "is written big-endian, which the format is not", "export it little-endian")


def floats(content: bytes, offset: int, count: int, subject: str, what: str) -> np.ndarray:
    """(count,) little-endian float32 at a byte offset, not copied; refused if the file is too short.

    Python integers do not overflow, so the check holds for any offset and count that a file may claim.
    """
    if offset < 0 or count < 0 or offset + 4 * count > len(content):
        raise bad_file(
            subject,
            f"{what} need {4 * count} bytes at {offset} but the file has {len(content)}",
            "it is truncated or damaged: export it again",
        )
    return np.frombuffer(content, "<f4", count, offset)
