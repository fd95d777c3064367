# SPDX-License-Identifier: Apache-2.0
"""The colours in a hair file. A bake does not need them, so they are kept beside the `Groom`, not in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

ROUNDING = 1e-3
"""A number outside 0 to 1 by no more than this is rounded, not wrong."""


@dataclass(frozen=True, eq=False)
class Look:
    """How strands are shown; arrays of one row hold for all points."""

    color: np.ndarray | None = None
    """(P, 3) or (1, 3) float32, red, green and blue from 0 to 1, as in the file."""
    opacity: np.ndarray | None = None
    """(P,) or (1,) float32 from 0 to 1; left out if nothing is transparent."""


def checked_look(color: np.ndarray | None, transparency: np.ndarray | None, subject: str) -> tuple[Look, list[str]]:
    """A file's colours (P, 3) or (1, 3) and transparency (P,) or (1,), without impossible values, and a line about them."""
    notes = []
    color = _within(color, f"{subject}: its colours", notes)
    transparency = _within(transparency, f"{subject}: its transparencies", notes)
    opaque = transparency is None or not transparency.any()
    return Look(color, None if opaque else 1 - transparency), notes


def _within(values: np.ndarray | None, what: str, notes: list[str]) -> np.ndarray | None:
    if values is None:
        return None
    if not (np.isfinite(values).all() and -ROUNDING <= values.min() and values.max() <= 1 + ROUNDING):
        notes.append(f"{what} are not all from 0 to 1; left out")
        return None
    return np.clip(values, np.float32(0), np.float32(1)).astype(np.float32, copy=False)
