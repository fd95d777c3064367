# SPDX-License-Identifier: Apache-2.0
"""Put the measurements of docs/ablations.md, by hairstyle and on real grooms, into the cards of the shipped models.

    python benchmarks/card.py

writes all of them: run it after a table was measured again, or a shipped model was made anew (`mean_model.py` and `livelier.py`
empty the card's report). `MOVES` says which model moves which row: it is the one that `neuralocks_core/deformation/model_choice.py` gives
that hair, as in the tables. The card also names what misses an aim. Only the report changes; the graphs stay the same, byte for byte.
`neuralocks inspect MODEL` prints it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from neuralocks_core.models import model_file
from neuralocks_core.models.shortcomings import HELD, HELD_BEGUN

DOCS = Path(__file__).resolve().parents[1] / "docs/ablations.md"
ARTISTS = ("hair_free", "hair_front", "hair_pulled", "hair_tail", "ruby_long_hair", "ruby_short_hair", "sintel_hair")
MOVES = {
    "strands": (),
    "strands_coily": ("coils", "afro", "testhair1"),
    "strands_curly": ("tight_curls",),
    "strands_long": ("long_straight", "wavy", "braid"),
    "strands_pinned": ("bun",),
    "strands_short": ("bob", "fringe", "pixie", "ratboy_mohawk", *ARTISTS),
    "strands_spiked": ("mohawk",),
    "strands_tied": ("ponytail",),
}
"""Model -> the rows that it moves: hairstyles and grooms."""
GENERAL = "strands"
"""The model for hair that no other knows. What is measured of it is what it does to hair that the others move."""


class Table(NamedTuple):
    """A table of the docs: its heading, how the card and a line of `falls short` call it, what its "inside %" is."""

    heading: str
    name: str
    where: str
    inside: str


BEFORE, AFTER = "inside before resolving, %", "inside after resolving, %"
TABLES = (
    Table("The shipped models, by hairstyle", "by style", "", BEFORE),
    Table("Real grooms in the shipped shot", "real grooms in the shipped shot", "", AFTER),
    Table("Hair that nobody grew for it", "real grooms in scripted clips", " in scripted clips", BEFORE),
)
OTHERS = Table(
    "The same grooms, by the model for all hair", "real grooms in the shipped shot, which other models move", "", AFTER
)
BESIDE = "Beside a static net"
"""The table that stands beside the one by hairstyle: the same hair in the same clips."""
SLIDERS = "Materials, by style"
COLUMNS = {
    "rigid: position": "position of rigid hair, %",
    "static: position": "position of a static net, %",
    "position": "position, %",
    "tips": "tips, %",
    "motion, median": "motion error",
    "static: motion, median": "motion error of a static net",
    "velocity": "velocity error",
    "motion ratio": "motion ratio",
}
"""Column of the docs -> its name in the card; "inside %" besides."""
AIMS = {
    "position, %": (0, 3),
    "motion error": (0, 0.4),
    "velocity error": (0, 0.65),
    "motion ratio": (0.85, 1.05),
    BEFORE: (0, 0.5),
    AFTER: (0, 0.03),
}
"""What hair is to be: from and to. Position is in percent of strand length, errors are relative to hair carried rigidly."""
EFFECT = (0.7, 1.3)
"""The same of each slider's effect over the solver's."""


def main() -> None:
    """Write the cards, and print what falls short."""
    text = DOCS.read_text(encoding="utf-8")
    for path in (model_file.shipped(), *model_file.specialists()):
        file = model_file.read(path, "strands")
        kept = {name: value for name, value in file.meta["report"].items() if name in (HELD, HELD_BEGUN)}
        found = report(text, path.stem)
        model_file.write(path, {**file.meta, "report": {**kept, **found}}, file.graphs)
        print(path.stem)
        for aim, rows in found["falls short"].items():
            print(f"  {aim}: {', '.join(rows)}")


def report(text: str, name: str) -> dict:
    """The card's part of the tables in a Markdown text, for one of the shipped models by its file's stem.

    Returns:
        By table: row -> column -> number; and under "falls short": aim -> the rows that miss it. Tables without a row are left out.
    """
    tables = [OTHERS] if name == GENERAL else TABLES
    rows = {each: measured(text, each, None if name == GENERAL else MOVES[name]) for each in tables}
    effects = table(text, SLIDERS)
    sliders = {style: effects[style] for style in MOVES[name] if style in effects}
    short = {**_errors(rows), **_sliders(sliders)}
    return {each.name: found for each, found in rows.items() if found} | {"falls short": short}


def measured(text: str, which: Table, names=None) -> dict[str, dict[str, float]]:
    """What the card holds of one table; all rows, or only those with one of these names. A dash is left out."""
    columns, beside = {**COLUMNS, "inside %": which.inside}, table(text, BESIDE)
    found = {name: beside.get(name, {}) | row for name, row in table(text, which.heading).items()}
    return {
        name: {own: row[column] for column, own in columns.items() if row.get(column) is not None}
        for name, row in found.items()
        if names is None or name in names
    }


def table(text: str, heading: str) -> dict[str, dict[str, float]]:
    """Row -> column -> number, from the first table below a heading, without the row of means."""
    lines = text.split(f"# {heading}\n", 1)[1].splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("|"))
    last = next((i for i, line in enumerate(lines[first:], first) if not line.startswith("|")), len(lines))
    head, _, *rows = ([cell.strip() for cell in line.strip("|").split("|")] for line in lines[first:last])
    return {row[0]: dict(zip(head[1:], map(_number, row[1:]), strict=True)) for row in rows if "*" not in row[0]}


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:  # a dash: nothing to measure
        return None


def _errors(tables: Mapping[Table, dict]) -> dict[str, list[str]]:
    found = {}
    for aim, (low, high) in AIMS.items():
        missed = [
            f"{name}{each.where} {row[aim]:g}"
            for each, rows in tables.items()
            for name, row in rows.items()
            if aim in row and not low <= row[aim] <= high
        ]
        if missed:
            found[f"{aim} ({f'{low:g} to {high:g}' if low else f'at most {high:g}'})"] = missed
    return found


def _sliders(rows: dict) -> dict[str, list[str]]:
    low, high = EFFECT
    found = {}
    for slider in ("stiffness", "weight", "damping", "clumping"):
        effects = {name: row[slider] for name, row in rows.items() if row[slider] is not None}
        if off := [f"{name} {effect:g}" for name, effect in effects.items() if not low <= effect <= high]:
            found[f"{slider} slider, effect over the solver's ({low:g} to {high:g})"] = off
    return found


if __name__ == "__main__":
    main()
