# SPDX-License-Identifier: Apache-2.0
"""What a stage's own numbers mean."""

from pathlib import Path

import pytest
from pxr import Usd

from usd.border.units import Border
from usd.shot.notes.stage_notes import layer_notes


@pytest.mark.parametrize(
    ("rate", "shown", "frame"),
    [(24, 30, 1.0), (1000, 30, 1000 / 30), (1000, 0.5, 1000 / 24), (1000, 1000, 1.0), (8, 8, 1.0), (1, 1, 1 / 24)],
)
def test_a_frame_is_a_time_code_unless_these_are_too_fine(rate, shown, frame):
    """Then it follows the stage's framesPerSecond, or 24 if those make no sense; if framesPerSecond equals the time codes per
    second, each time code is a frame, unless the stage counts seconds.
    """
    stage = Usd.Stage.CreateInMemory()
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(shown)
    assert Border.of(stage).frame == frame


@pytest.mark.parametrize(
    ("rate", "shown", "told"), [(1000, 30, 0), (1000, 1000, 0), (24, None, 0), (1000, 0.5, 1), (1000, None, 1)]
)
def test_a_guessed_frame_is_told(rate, shown, told):
    """A stage in milliseconds that says nothing more is baked at 24 frames per second."""
    stage = Usd.Stage.CreateInMemory()
    stage.SetTimeCodesPerSecond(rate)
    if shown is not None:
        stage.SetFramesPerSecond(shown)
    assert len(Border.of(stage).frame_notes("shot.usda")) == told
    assert len(layer_notes(stage, Path("shot.usda"))) == 1 + told  # no unit is authored
