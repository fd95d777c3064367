# SPDX-License-Identifier: Apache-2.0
"""What a model's own report says against using it. A report is read from a file, and may contain anything."""

import math
from collections.abc import Mapping

HELD, HELD_BEGUN = "held out", "held out, begun with"
"""Keys of a strand model's report for the gauge on held-out motion and strands."""
KEPT = "strands held out"
"""Key of a strand model's training: how many strands of each groom, 0 where it has too few locks."""
NO_BETTER = 1.02
"""A training whose error is more than this many times that of the model it began with is reported; less may be chance."""


def shortcomings(subject, kind: str, report: Mapping) -> list[str]:
    """Notes for a user on a model that learned too little to be worth using; mostly none.

    Args:
        subject: what the notes begin with, such as the model's path.
        kind: `strands` or `rig`.
        report: report of the model, as training wrote it.
    """
    facts = _of_strands(report) if kind == "strands" else _of_a_rig(report)
    return [f"{subject}: {fact}; train longer, or with other options" for fact in facts]


def _of_strands(report: Mapping) -> list[str]:
    error, begun = (_number(report, name, "motion") for name in (HELD, HELD_BEGUN))
    if error is None:
        return []
    unseen = f"its motion error on motion that it never saw is {error:.2f}, where"
    if error > 1:
        return [f"{unseen} hair carried rigidly has 1"]
    if begun is not None and error > NO_BETTER * begun:
        return [f"{unseen} the model that it began with has {begun:.2f}"]
    return []


def _of_a_rig(report: Mapping) -> list[str]:
    facts = []
    errors = report.get("motion_error")
    of_springs = [_number(errors, name) for name in errors if "spring" in str(name)] if isinstance(errors, dict) else []
    error, springs = _number(errors, "dynamic network"), min((e for e in of_springs if e is not None), default=None)
    if error is not None and error >= min(1.0 if springs is None else springs, 1.0):
        others = "hair carried rigidly has 1"
        if springs is not None:
            others = f"spring bones have {springs:.2f} and hair carried rigidly 1"
        facts.append(f"its motion error on motion that it never saw is {error:.2f}, where {others}")
    off, rigid = (_number(report, "tip_error_mm", name) for name in ("network", "rigid"))
    if off is not None and rigid is not None and off >= rigid > 0:
        facts.append(
            f"in held poses the hair's tips are {off:.0f} mm from where they would hang, where hair carried rigidly is "
            f"{rigid:.0f} mm off"
        )
    return facts


def _number(values, *names: str) -> float | None:
    """The finite number under nested names in dicts; None if there is none."""
    for name in names:
        values = values.get(name) if isinstance(values, Mapping) else None
    if not isinstance(values, int | float) or isinstance(values, bool):
        return None
    try:
        return float(values) if math.isfinite(values) else None
    except OverflowError:  # a whole number may have any size
        return None
