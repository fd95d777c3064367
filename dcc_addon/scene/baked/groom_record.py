# SPDX-License-Identifier: GPL-3.0-or-later
"""What hair was when its cache was baked, stored with its object: the groom, its place, what the panel sets, and the bodies that it is
kept out of. A cache goes on showing these as they were.
"""

import zlib

from ...services.panel.sliders import SLIDERS
from ...session import session
from ..hair.curves import points
from ..motion.rigging import hangs, stands
from ..objects import records
from ..objects.animated import animated
from . import body_record, character_record

KEY = "neuralocks_groomed"
"""The property of the object: a number for each part."""


def remember(hair, scene) -> None:
    """Note what the hair is in a scene, unless it belongs to another file."""
    if hair.library is None:
        hair[KEY] = records.as_text(_numbers(hair, scene))


def forget(hair) -> None:
    """Its cache was removed."""
    if hair.library is None:
        hair.pop(KEY, None)


def changed(hair, scene) -> list[str]:
    """What was changed since the cache was baked; nothing if that is unknown."""
    return records.changed(hair.get(KEY, ""), _numbers(hair, scene))


def _numbers(hair, scene) -> dict[str, int | None]:
    armature, moving = hair.neuralocks_hair.armature, animated(hair.animation_data)
    body, driven = body_record.numbers_of_bodies(armature, scene) if armature else (0, 0)
    return {
        "groom": _number_of(hair.data),
        "place": records.number_of([*hangs(hair), *stands(hair, moving)]),
        "sliders": _sliders(hair),
        "wind": character_record.wind(armature),
        **character_record.others(armature, scene),
        "body": body,
        "Model": character_record.model(hair, "strands"),
        "drivers of the body": driven,
    }


def _sliders(hair) -> int:
    own, moving = hair.neuralocks_hair, animated(hair.animation_data)
    set_so = [round(getattr(own, s.name), 6) for s in SLIDERS if f"neuralocks_hair.{s.name}" not in moving]
    return records.number_of([*set_so, own.resolve])


def _number_of(data) -> int:
    """A number of the points at rest. The panel asks in every redraw, and a large groom takes longer to read than that may take."""
    if data.name_full not in session.read.grooms:
        session.read.grooms[data.name_full] = zlib.crc32(points(data))
    return session.read.grooms[data.name_full]
