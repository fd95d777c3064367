# SPDX-License-Identifier: Apache-2.0
"""The units and axes that users may give for a file that does not state them."""

import math

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.number_words import plain_number

UNITS = {"mm": 0.001, "cm": 0.01, "m": 1.0, "in": 0.0254}
"""Name -> metres."""


def metres_per_unit(unit: str | float) -> float:
    """Metres per unit, from a name in UNITS (upper or lower case) or a number of metres.

    Raises:
        NeuralocksError: it is neither.
    """
    try:
        value = UNITS.get(str(unit).strip().lower()) or plain_number(unit)
    except (TypeError, ValueError, OverflowError):
        value = math.nan
    if not 1e-6 <= value <= 1e6:
        raise NeuralocksError(f"--unit {unit}: is not a unit; give {', '.join(UNITS)}, or metres per unit")
    return value


def upward_axis(up: str) -> str:
    """The axis "Y" or "Z", from either letter in upper or lower case.

    Raises:
        NeuralocksError: it is neither.
    """
    axis = str(up).strip().upper()
    if axis not in ("Y", "Z"):
        raise NeuralocksError(f"--up {up}: is not an axis; give Y or Z")
    return axis
