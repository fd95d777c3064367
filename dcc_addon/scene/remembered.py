# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene remembers of things that were changed for live hair, as text in the file: anybody may have written it."""

import json


def remembered(text: str) -> dict[str, list]:
    """Values by name; none where the text holds something else."""
    try:
        found = json.loads(text or "{}")
    except (json.JSONDecodeError, RecursionError):
        return {}
    pairs = found.items() if isinstance(found, dict) else ()
    return {name: values for name, values in pairs if isinstance(values, list)}
