# SPDX-License-Identifier: GPL-3.0-or-later
"""What hair was when its cache was baked, stored with its object: the groom, its place, and what the panel sets. A cache goes on showing
these as they were.
"""

import zlib

from ..services.sliders import SLIDERS
from ..services.wind import Blowing
from ..session import session
from .animated import animated
from .curves import points
from .rigging import hangs, stands

KEY = "neuralocks_groomed"
"""The property of the object: a number for each of PARTS."""
PARTS = ("groom", "place", "sliders", "wind")


def remember(hair) -> None:
    """Note what the hair is, unless it belongs to another file."""
    if hair.library is None:
        hair[KEY] = " ".join(_numbers(hair))


def forget(hair) -> None:
    """Its cache was removed."""
    if hair.library is None:
        hair.pop(KEY, None)


def changed(hair) -> list[str]:
    """Which of PARTS were changed since the cache was baked; none if that is unknown."""
    told = str(hair.get(KEY, "")).split(" ")
    if len(told) != len(PARTS):
        return []
    return [part for part, then, now in zip(PARTS, told, _numbers(hair), strict=True) if then != now]


def _numbers(hair) -> list[str]:
    own, moving = hair.neuralocks_hair, animated(hair.animation_data)
    set_so = [round(getattr(own, s.name), 6) for s in SLIDERS if f"neuralocks_hair.{s.name}" not in moving]
    air = own.armature and own.armature.neuralocks_character
    blown = Blowing.of(air.wind, air.wind_direction, air.gusts) if air else Blowing()
    found = [*hangs(hair), *stands(hair, moving)], [*set_so, own.resolve, own.model], blown
    return [f"{number:08x}" for number in (_number_of(hair.data), *(zlib.crc32(repr(each).encode()) for each in found))]


def _number_of(data) -> int:
    """A number of the points at rest. The panel asks in every redraw, and a large groom takes longer to read than that may take."""
    if data.name_full not in session.grooms:
        session.grooms[data.name_full] = zlib.crc32(points(data))
    return session.grooms[data.name_full]
