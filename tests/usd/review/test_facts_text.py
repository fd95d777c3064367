# SPDX-License-Identifier: Apache-2.0
"""Facts as a person reads them."""

import pytest

from neuralocks_core.models import model_file
from usd.review.facts_text import as_text
from usd.review.inspect import inspect


@pytest.mark.parametrize("path", (model_file.shipped(), *model_file.specialists()), ids=lambda path: path.stem)
def test_a_shipped_model_has_no_empty_heading(path):
    lines = as_text(inspect(path)).splitlines()
    pads = [len(line) - len(line.lstrip()) for line in lines]
    empty = [
        line for line, pad, then in zip(lines, pads, [*pads[1:], 0], strict=True) if line[-1] == ":" and then <= pad
    ]
    assert not empty and any("falls short" in line for line in lines)


def test_what_holds_nothing_is_none():
    assert as_text({"report": {"falls short": {}, "rows": [], "best": None}}).split() == (
        "report: falls short: none rows: none best: none".split()
    )


@pytest.mark.parametrize(
    "odd",
    [
        {"rows": [{}]},
        {"rows": [{"a": 1}, 2]},
        {"joint names": 5},
        {"joint names": [None]},
        {"a": {"b": 10**400, "c": 1}},
    ],
)
def test_a_card_that_somebody_else_wrote_may_hold_anything(odd):
    assert as_text({"training": odd}).startswith("training:\n")
