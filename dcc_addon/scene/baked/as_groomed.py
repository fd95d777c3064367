# SPDX-License-Identifier: GPL-3.0-or-later
"""What hair was when its cache was baked, stored with its object: the groom, its place, what the panel sets, and the bodies that it is
kept out of. A cache goes on showing these as they were.
"""

import zlib

from ...services.panel.sliders import SLIDERS
from ...session import session
from ..hair.curves import points
from ..motion.rigging import hangs, stands
from ..objects import recorded
from ..objects.animated import animated
from . import as_carried, body_known

KEY = "neuralocks_groomed"
"""The property of the object: a number for each part."""
FEWEST = 4
"""Parts that every record has."""
OLDER = 8
"""Records with no more parts tell the model by its name, with the sliders."""


def remember(hair, scene) -> None:
    """Note what the hair is in a scene, unless it belongs to another file."""
    if hair.library is None:
        hair[KEY] = recorded.as_text(_numbers(hair, scene))


def forget(hair) -> None:
    """Its cache was removed."""
    if hair.library is None:
        hair.pop(KEY, None)


def keep(things) -> None:
    """Before a save, which names models otherwise if it goes to another folder: let older records that still hold tell what is in the
    model's file.
    """
    for hair in (thing for thing in things if thing.library is None and KEY in thing):
        told = str(hair[KEY]).split(" ")
        if FEWEST <= len(told) <= OLDER and told[2:3] == [recorded.as_text({"": _sliders(hair, older=True)})]:
            told[2], unknown = recorded.as_text({"": _sliders(hair)}), "-"
            told += [unknown] * (OLDER - len(told))
            hair[KEY] = " ".join([*told, recorded.as_text({"": _model(hair)})])


def changed(hair, scene) -> list[str]:
    """What was changed since the cache was baked; nothing if that is unknown."""
    told = str(hair.get(KEY, ""))
    return recorded.changed(told, _numbers(hair, scene, older=len(told.split(" ")) <= OLDER), FEWEST)


def _numbers(hair, scene, older: bool = False) -> dict[str, int | None]:
    """Of all parts; `older` if the number of the sliders is to be compared with an older record's."""
    armature, moving = hair.neuralocks_hair.armature, animated(hair.animation_data)
    body, driven = body_known.numbers_of_bodies(armature, scene) if armature else (0, 0)
    return {
        "groom": _number_of(hair.data),
        "place": recorded.number_of([*hangs(hair), *stands(hair, moving)]),
        "sliders": _sliders(hair, older),
        "wind": as_carried.wind(armature),
        **as_carried.others(armature, scene),
        "body": body,
        "Model": _model(hair),
        "drivers of the body": driven,
    }


def _sliders(hair, older: bool = False) -> int:
    own, moving = hair.neuralocks_hair, animated(hair.animation_data)
    set_so = [round(getattr(own, s.name), 6) for s in SLIDERS if f"neuralocks_hair.{s.name}" not in moving]
    return recorded.number_of([*set_so, own.resolve, *([own.model] if older else [])])


def _model(hair) -> int | None:
    return as_carried.model(hair, "strands")


def _number_of(data) -> int:
    """A number of the points at rest. The panel asks in every redraw, and a large groom takes longer to read than that may take."""
    if data.name_full not in session.read.grooms:
        session.read.grooms[data.name_full] = zlib.crc32(points(data))
    return session.read.grooms[data.name_full]
