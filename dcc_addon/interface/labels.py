# SPDX-License-Identifier: GPL-3.0-or-later
"""What the sidebar's panels consist of: texts of any length in lines that fit, hints, bars."""

import blf
import bpy

from ..live.unsampled import FIRST
from ..services.panel.panel_errors import for_the_panel
from ..services.panel.wrapping import wrapped
from ..session import session

MARGINS, ICON = 70, 25
"""Width of the sidebar's tabs with the margins of a panel and of a box in it, and of an icon with its space, at scale 1."""
LEAST = 90
"""The narrowest line, at scale 1: in a narrower sidebar, lines are cut rather than one letter long."""


def words(layout, text: str, icon: str, lines: int = 0) -> int:
    """Show a text in as many lines as it needs, at least `lines`; returns how many it needs."""
    found = wrapped(text, *_room(icon))
    column = layout.column(align=True)
    column.scale_y = 0.8
    for number in range(max(lines, len(found))):
        line = found[number] if number < len(found) else ""
        # Untranslated: Blender would translate a line that is one of its own words, such as an object called Head.
        column.label(text=line, icon=icon if number == 0 else "BLANK1" if icon != "NONE" else "NONE", translate=False)
    return len(found)


def message(layout, name: str) -> None:
    """What went wrong with an object, or what it waits for, if anything."""
    if text := session.said.messages.get(name):
        words(layout, for_the_panel(text), "TIME" if text.endswith(FIRST) else "ERROR")


def hint(text: str) -> dict[str, str]:
    """What a property shows while it is empty, if Blender supports that."""
    return {"placeholder": text} if "placeholder" in bpy.types.UILayout.bl_rna.functions["prop"].parameters else {}


def progress(layout, done: float, text: str) -> None:
    """How far something is, from 0 to 1; older Blenders draw no bar."""
    if hasattr(layout, "progress"):
        layout.progress(factor=done, text=text)
    else:
        layout.label(text=text, icon="TIME")


def _room(icon: str) -> tuple:
    """How wide a line beside this icon may be, and a function that measures lines; without a window it counts letters."""
    region, preferences = bpy.context.region, bpy.context.preferences
    scale = preferences.system.ui_scale
    if not region or not scale:
        return 40, len
    style = preferences.ui_styles[0]
    letters = getattr(style, "widget_label", None) or style.widget  # Blender 5 has no separate style for labels
    blf.size(0, letters.points * scale)
    room = region.width - scale * (MARGINS + (ICON if icon != "NONE" else 0))
    return max(room, scale * LEAST), lambda line: blf.dimensions(0, line)[0]
