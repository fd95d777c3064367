# SPDX-License-Identifier: GPL-3.0-or-later
"""The report card in the few lines that a sidebar has room for."""

import math

from neuralocks_core.evaluation.report import LABELS, Card

SHOWN = (
    "stretch_percent_max",
    "penetration_percent",
    "penetration_3mm_percent",
    "penetration_worst_mm",
    "inside_at_rest_percent",
    "droop_cm",
    "speed_cm_s",
    "swing_percent",
    "settling_s",
    "jitter_mm",
)
"""What an artist can see in the hair and act on; energies, for example, are for comparing solvers."""


def lines_of(card: Card) -> list[str]:
    """One line per measure, without those that could not be measured; then the notes."""
    lines = []
    for values in card.grooms.values():
        for key in SHOWN:
            label, unit, _ = LABELS[key]
            value = values.get(key)
            if isinstance(value, (int, float)) and math.isfinite(value):
                lines.append(f"{label}: {_plain(value)} {unit}".rstrip())
    return [*lines, *card.notes]


def _plain(value: float) -> str:
    """A number to three digits, with at most two after the point; smaller values are 0."""
    places = 2 if abs(value) < 10 else 1 if abs(value) < 100 else 0
    return f"{round(value, places) + 0.0:.{places}f}".rstrip("0").rstrip(".") if places else f"{value:.0f}"
