# SPDX-License-Identifier: Apache-2.0
"""Put the measurements of docs/ablations.md, by hairstyle and on real grooms, into the card in a model file.

    python benchmarks/card.py MODEL [NAME ...]

Each of the shipped models moves other hair: NAME is a row of the tables, a hairstyle or a groom. The model for all hair may move none of
these.
The card also says in words which hair the model does not get right: motion error over 0.6, position error over 5 % of
length, sliders off the solver's effect by more than 30 %. Only the card changes; the graphs stay the same, byte for byte.
`neuralocks inspect MODEL` prints it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from neuralocks_core import model

DOCS = Path(__file__).resolve().parents[1] / "docs/ablations.md"
STYLES, GROOMS, SLIDERS = "The shipped models, by hairstyle", "Real grooms in the shipped shot", "Materials, by style"
"""Headings of the tables."""
MOTION, POSITION, OFF = 0.6, 5.0, 0.3


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME")
    arguments = parser.parse_args()
    file = model.read(arguments.model, "strands")
    found = measured(DOCS.read_text(encoding="utf-8"), arguments.names)
    meta = {**file.meta, "report": {**file.meta["report"], **found}}
    model.write(arguments.model, meta, file.graphs)
    print("\n".join(meta["report"]["falls short"]))


def measured(text: str, names=None) -> dict:
    """The card's part of the tables in a Markdown text; all rows, or only those with one of these names."""
    styles, grooms, sliders = (
        {name: row for name, row in table(text, heading).items() if names is None or name in names}
        for heading in (STYLES, GROOMS, SLIDERS)
    )
    styles, grooms = (
        {
            name: {"position": row["position"], "motion": row["motion, median"], "inside": row["inside %"]}
            for name, row in rows.items()
        }
        for rows in (styles, grooms)
    )
    return {
        "by style": styles,
        "real grooms": grooms,
        "falls short": [*_errors({**styles, **grooms}), *_sliders(sliders)],
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


def _errors(rows: dict) -> list[str]:
    lines = []
    for name, row in rows.items():
        if (row["motion"] or 0) > MOTION:
            lines.append(f"{name}: {row['motion']:g} of the motion's error is left (rigid hair has 1)")
        if row["position"] > POSITION:
            lines.append(f"{name}: position error of {row['position']:g} % of length")
    return lines


def _sliders(rows: dict) -> list[str]:
    lines = []
    for slider in ("stiffness", "weight", "damping", "clumping"):
        effects = {name: row[slider] for name, row in rows.items() if row[slider] is not None}
        off = [f"{name} {effect:g}" for name, effect in effects.items() if round(abs(effect - 1), 6) > OFF]
        if off:
            lines.append(f"{slider} slider, effect over the solver's: {', '.join(off)}")
    return lines


if __name__ == "__main__":
    main()
