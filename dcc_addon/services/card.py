# SPDX-License-Identifier: GPL-3.0-or-later
"""The report card in the few lines that a sidebar has room for."""

import math

from neuralocks_core.evaluation.report import LABELS, Card


def lines_of(card: Card) -> list[str]:
    """One line a measure, without those that could not be measured; then the notes."""
    lines = []
    for values in card.grooms.values():
        for key, (label, unit, _) in LABELS.items():
            value = values.get(key)
            if isinstance(value, (int, float)) and math.isfinite(value):
                lines.append(f"{label}: {value:.3g} {unit}".rstrip())
    return [*lines, *card.notes]
