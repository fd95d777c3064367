# SPDX-License-Identifier: Apache-2.0
"""The cards of the shipped models say what the docs say of them."""

import runpy
from pathlib import Path

from neuralocks_core import model

ROOT = Path(__file__).resolve().parents[3]


def test_the_cards_in_the_shipped_models_are_what_the_docs_measured():
    card = runpy.run_path(str(ROOT / "benchmarks/card.py"))
    text = (ROOT / "docs/ablations.md").read_text(encoding="utf-8")
    told = []
    for path in (model.shipped(), *model.specialists()):
        report = model.read(path).meta["report"]
        names = [*report["by style"], *report["real grooms"]]
        measured = card["measured"](text, names)
        assert {name: report.get(name) for name in measured} == measured, f"run benchmarks/card.py on {path.name}"
        told += names
    every = card["measured"](text)
    assert sorted(told) == sorted([*every["by style"], *every["real grooms"]]), "each row is in the card of one model"


def test_what_falls_short_is_named():
    card = runpy.run_path(str(ROOT / "benchmarks/card.py"))
    rows = "| a | position | motion, median | inside % |\n| --- | --- | --- | --- |\n"
    text = f"# {card['STYLES']}\n{rows}| coils | 6 | 0.2 | 0 |\n| **all** | 9 | 0.9 | 0 |\n"
    text += f"\n## {card['GROOMS']}\n\n{rows}| fur | 0.1 | 0.7 | 0 |\n| skin | 0.1 | - | 0 |\n"
    text += f"\n### {card['SLIDERS']}\n| style | stiffness | weight | damping | clumping |\n| --- | --- | --- | --- | --- |\n"
    text += "| bob | 0.7 | 1.3 | no effect | 0.4 |\n"
    said = " ".join(card["measured"](text)["falls short"])
    assert "coils: position error of 6 %" in said and "fur: 0.7 of the motion's error" in said and "bob 0.4" in said
    assert not any(word in said for word in ("skin", "all", "stiffness", "weight", "damping"))
