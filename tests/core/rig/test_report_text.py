# SPDX-License-Identifier: Apache-2.0
"""The card of a rig model in words."""

import pytest

from neuralocks_core.rig.report_text import report_lines


@pytest.mark.parametrize(
    ("history", "words"),
    [
        (0, "900 multiply-adds and"),
        (770, "900 multiply-adds of the network and 770 of the history and"),
    ],
)
def test_a_card_says_what_its_cost_counts(history, words):
    report = {"motion_error": {"network": 0.3}, "rates": {"network": {"24 fps": 0.1}}}
    report["teleport"] = {"network": {"flung_mm": 1.0, "seconds": 0.1}}
    report["cost"] = {"network": {"multiply_adds": 900, "history_multiply_adds": history, "bytes_carried_on": 8}}
    assert words in report_lines(report)[0]
