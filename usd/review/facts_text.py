# SPDX-License-Identifier: Apache-2.0
"""The facts that `inspect` finds, as lines for a person."""

from neuralocks_core.anatomy.joint_names import leaf

from ..border.told_once import grouped, told_once, without_paths

LONG = {"curve": "points", "hair": "strands"}
"""Lists of a model's card with up to thousands of items -> what these are."""
ENDS = ("frames", "vertices per strand")
"""Facts that are the least and the greatest, or both in one."""


def as_text(facts: dict, indent: int = 0) -> str:
    """The facts for a person to read; facts that differ only in their prim's path appear once."""
    lines = []
    pad = "  " * indent
    for name, value in facts.items():
        if name in ("stops", "spoils"):
            continue
        if name in LONG and isinstance(value, list):
            lines.append(f"{pad}{name}: {len(value)} {LONG[name]}, in --json")
        elif name == "began with":  # each training records the one that it started from
            lines.append(f"{pad}trainings before this one: {_trainings(value)}, in --json")
        elif _is_table(value):
            lines.append(f"{pad}{name}:")
            lines += (
                f"{pad}  {row}: {'; '.join(f'{k} {v:g}' for k, v in each.items())}" for row, each in value.items()
            )
        elif isinstance(value, dict) and value:
            lines += [f"{pad}{name}:", as_text(value, indent + 1)]
        elif isinstance(value, list) and value and all(isinstance(entry, dict) and entry for entry in value):
            lines += _each(name, value, indent)
        else:
            lines.append(f"{pad}{name}: {_short(name, value)}")
    if indent == 0:
        lines += [f"would stop a bake: {line}" for line in told_once(facts.get("stops", []))]
        lines += [f"note: {line}" for line in told_once(facts.get("spoils", []))]
    return "\n".join(line for line in lines if line)


def _each(name: str, entries: list[dict], indent: int) -> list[str]:
    """Lines of several facts of one kind: a line each if they are short."""
    pad = "  " * indent
    if len(entries[0]) <= 3 and not any(isinstance(value, list) for value in entries[0].values()):
        lines = [f"{pad}{name}:"]
        for (_, first), *others in (entry.items() for entry in entries):
            lines.append(f"{pad}  {first}: {', '.join(f'{k} {v}' for k, v in others)}")
        return lines
    lines = []
    for entry, *same in grouped(entries, lambda entry: without_paths(repr(entry))):
        lines += [f"{pad}{name.removesuffix('s')}:", as_text(entry, indent + 1)]
        if same:
            lines.append(f"{pad}  likewise: {', '.join(str(next(iter(each.values()))) for each in same)}")
    return lines


def _is_table(value) -> bool:
    """Whether it has rows of several numbers, of which each is a line."""
    rows = list(value.values()) if isinstance(value, dict) else []
    numbers = (isinstance(row, dict) and len(row) > 1 and all(_is_number(v) for v in row.values()) for row in rows)
    return bool(rows) and all(numbers)


def _is_number(value) -> bool:
    """Whether it can be written with few digits, which whole numbers of hundreds of digits cannot."""
    return isinstance(value, float) or isinstance(value, int) and abs(value) < 1e300


def _short(name: str, value) -> str:
    """A fact's value, or list of values, in a line."""
    if isinstance(value, list):
        if name in ENDS:
            return " to ".join(map(_of_one, value)) or "none"
        own = name == "joint names" and all(isinstance(joint, str) for joint in value)
        return ", ".join(map(leaf if own else str, value)) or "none"
    return "none" if value is None or value == {} else _of_one(value)


def _of_one(value) -> str:
    return f"{value:g}" if isinstance(value, float) else f"{value}"


def _trainings(card) -> int:
    """How many trainings a card lists: its own, and those that it started from."""
    count = 0
    while isinstance(card, dict):
        card, count = card.get("began with"), count + 1
    return count
