# SPDX-License-Identifier: Apache-2.0
"""Values that every JSON reader accepts: NaN and infinity, which JSON lacks, become null."""

import json
import math
import re

_NUMBER = r"-?[\d.]+(?:[eE][-+]?\d+)?"
_NUMBERS = re.compile(rf"\[\n\s*{_NUMBER}(?:,\n\s*{_NUMBER})*\n\s*\]")  # strings hold no line ends as such


def plain(value, digits: int | None = None):
    """A copy of nested dicts, lists and numbers, including numpy's, for `json.dumps`; other values stay as they are.

    Args:
        value: what to copy.
        digits: significant digits to which numbers are rounded; left out, they are not rounded.
    """
    if isinstance(value, dict):
        return {str(key): plain(item, digits) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item, digits) for item in value]
    if getattr(value, "ndim", None) == 0:  # numpy's, without importing numpy: commands that do not need it start sooner
        value = value.item()
    if isinstance(value, float):
        if not math.isfinite(value):
            return None
        return value if digits is None else float(f"{value:.{digits}g}")
    return value


def readable(value) -> str:
    """Values that JSON knows as indented text, with each list of numbers on one line."""
    return _NUMBERS.sub(lambda found: f"[{', '.join(re.findall(_NUMBER, found[0]))}]", json.dumps(value, indent=1))
