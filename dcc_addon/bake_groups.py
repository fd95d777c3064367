# SPDX-License-Identifier: GPL-3.0-or-later
"""Which hair is baked, and which of it together: hair with the same look goes into one file."""

from typing import NamedTuple

from neuralocks_core.errors import NeuralocksError

from .live.character_wind import blowing
from .live.live_strands import material_words, typed
from .live.models import load_model, model_path, named_model
from .scene.hair import curves
from .services.hair.wind import Blowing
from .services.panel.sliders import MOTION


class Look(NamedTuple):
    """What hair that is baked together has in common, as it was when the bake began."""

    material: tuple[str, ...]
    motion: float
    resolve: bool
    model: str | None
    """None if the hair names none."""
    blowing: Blowing


def grouped(hairs, undrawn) -> tuple[list[tuple[Look, list[str]]], list[str]]:
    """The names of hair objects that can be baked, by look, and notes on the others. They are sorted by name: no slider may swap
    the hair of two numbered files, which another scene refers to.

    Args:
        hairs: hair objects, one at least.
        undrawn: names of those that are never drawn.

    Raises:
        NeuralocksError: one cannot be baked, unless it has no strands or is undrawn; or none can.
    """
    looks: dict[Look, list[str]] = {}
    left_out = []
    for hair in hairs:
        try:
            curves.check(hair)
            looks.setdefault(_look(hair), []).append(hair.name_full)
        except NeuralocksError as error:
            if len(hair.data.points) and hair.name_full not in undrawn:
                raise
            left_out.append(str(error))
    if not looks:
        raise NeuralocksError(left_out[0])
    found = {name for names in looks.values() for name in names}
    told = [
        f"{name}: it is hidden in renders, so it is invisible in the file; to have it drawn, show it in renders and bake again"
        for name in undrawn
        if name in found
    ]
    return sorted(looks.items(), key=lambda look: min(look[1])), [*(f"{text} (left out)" for text in left_out), *told]


def _look(hair) -> Look:
    settings = hair.neuralocks_hair
    wind = blowing(settings.armature) if load_model(model_path(hair)).feels_wind else Blowing()
    return Look(
        tuple(material_words(settings)), typed(settings, MOTION.name), settings.resolve, named_model(hair), wind
    )
