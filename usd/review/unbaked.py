# SPDX-License-Identifier: Apache-2.0
"""A stage whose hair is not baked, as a preview shows it: as it was groomed, stiff on the head."""

from dataclasses import dataclass

import numpy as np

from neuralocks_core.rotation import transformed

from ..border.time_codes import time_codes
from ..shot.stage import Shot, StageGroom
from .baked import Baked


@dataclass(frozen=True)
class Groomed(Baked):
    """Like a bake of hair that only goes with what carries it."""

    def world(self, item: StageGroom, code: float) -> np.ndarray:
        """Points (P, 3) of a groom, as it is drawn, at a time code, world metres."""
        attachment = item.attachment
        return transformed(item.groom.points, attachment.character.carrying(attachment.rig.joints_at(code)))

    def broken(self, items) -> list[str]:
        """No notes: no frame is lacking."""
        return []


def as_groomed(shot: Shot, first_alone: bool) -> Groomed:
    """The frames of a shot in which no groom has samples, or the first one alone."""
    codes = [shot.first] if first_alone else time_codes(None, shot.first, shot.last, frame=shot.border.frame)
    return Groomed(shot, np.array(codes))
