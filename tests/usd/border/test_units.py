# SPDX-License-Identifier: Apache-2.0
"""What a stage's own numbers mean."""

import pytest
from pxr import Usd

from usd.border.units import Border


@pytest.mark.parametrize(("rate", "shown", "frame"), [(24, 30, 1.0), (1000, 30, 1000 / 30), (1000, 0.5, 1000 / 24)])
def test_a_frame_is_a_time_code_unless_these_are_too_fine(rate, shown, frame):
    """Then it is one of the frames a second that the stage is shown with, or 24 where those cannot be meant."""
    stage = Usd.Stage.CreateInMemory()
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(shown)
    assert Border.of(stage).frame == frame
