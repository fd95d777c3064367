# SPDX-License-Identifier: Apache-2.0
"""Numbers and names that a caller gives for an argument, checked before anything is read."""

import math
from collections.abc import Mapping
from numbers import Integral, Real

from neuralocks_core.errors import NeuralocksError


def check_number(option: str, value, low: float, high: float = math.inf, *, whole: bool = False) -> None:
    """Refuse what is not a number, or not within a range.

    Args:
        option: its name, such as `--strength`.
        value: as given.
        low, high: least and largest.
        whole: whether it must be a whole number.

    Raises:
        NeuralocksError: names the option and the range.
    """
    known = isinstance(value, Integral if whole else Real) and not isinstance(value, bool)
    if not (known and low <= value <= high):
        kind, end = "a whole number" if whole else "a number", f" to {high:g}" if high < math.inf else " on"
        raise NeuralocksError(f"{option} {value!r}: must be {kind} from {low:g}{end}")


def check_names(option: str, values) -> None:
    """Refuse what is not a list of names.

    Args:
        option: its name, such as `--chains`.
        values: as given; None stands for none.

    Raises:
        NeuralocksError: names the option.
    """
    if values is not None and not (
        isinstance(values, list | tuple | set) and all(isinstance(name, str) for name in values)
    ):
        raise NeuralocksError(f"{option} {values!r}: must be a list of names, such as ['Hair*_1']")


def joints_by_hand(head, joints) -> dict[str, str]:
    """The joints that a user names, the head among them, by their meanings.

    Raises:
        NeuralocksError: these are no names.
    """
    if joints is not None and not isinstance(joints, Mapping):
        raise NeuralocksError(
            f"--joint {joints!r}: must be a dict of joints by their meanings, such as {{'neck': 'Neck1'}}"
        )
    named = {**(joints or {}), **({"head": head} if head else {})}
    for meaning, joint in named.items():
        if not isinstance(meaning, str) or not isinstance(joint, str):
            option = "--head" if meaning == "head" else f"--joint {meaning}"
            raise NeuralocksError(f"{option} {joint!r}: must be a joint's name")
    return named
