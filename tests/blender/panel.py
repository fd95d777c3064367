# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panels say. Blender draws them itself, which it does without a window up to the point where it would open one."""

import ctypes
import json
import os
import signal
import sys
import traceback
import warnings
from tempfile import TemporaryFile
from types import SimpleNamespace

import bpy

LIMIT = 30
"""Longest time for a drawing, which only reads [s]."""
NOISE = "no icon for icon ID"
"""The pictures of icons come with a window; their names are known without one."""


def drawn(icon: str = "") -> list[str]:
    """Everything that the panels and the menu say now; only text beside this icon, if one is given."""
    from dcc_addon.interface import menu, panels
    from dcc_addon.operators.training import known_problem

    def draw(layout):
        asked = (cls for cls in panels.CLASSES if getattr(cls, "poll", bool)(bpy.context))
        for cls in (*asked, *menu.CLASSES):
            cls.draw(SimpleNamespace(layout=layout), bpy.context)
        menu.draw(SimpleNamespace(layout=layout), bpy.context)

    known_problem()  # asks once; each drawing would, for it forgets the answer
    return shown(draw, icon)


def told_changed(remedy: str = "Bake and Attach") -> list[str]:
    """What the panel says was changed since a bake, and can be renewed by `remedy`."""
    lines = " ".join(drawn()).replace("Changed since", "\nChanged since").replace(" again", " again\n").splitlines()
    notes = [line.split("shows it as it was: ")[1] for line in lines if "shows it as it was: " in line]
    found = [note.split("; ") for note in notes]
    assert all(ending == f"press {remedy} again" for _, ending in found), notes
    return [part for parts, _ in found for part in parts.split(", ")]


def preferences() -> list[str]:
    """Everything that the add-on's preferences say now."""
    addons = bpy.context.preferences.addons
    addon = addons.get("dcc_addon") or addons.new()
    addon.module = "dcc_addon"
    own = addon.preferences

    def draw(layout):
        type(own).layout = layout  # as Blender's own list of add-ons does
        own.draw(bpy.context)

    try:
        return shown(draw)
    finally:
        addons.remove(addon)


def shown(draw, icon: str = "") -> list[str]:
    """What `draw(layout)` says in a panel that Blender draws, in a copy of this process that ends there. What Blender does
    not know, or forbids while it draws, is an error.
    """
    bpy.context.view_layer.update()  # as before any drawing
    _write_out()
    with TemporaryFile("w+") as answer, TemporaryFile("w+") as complaints:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of threads, which the copy does not have
            copy = os.fork()
        if not copy:
            _draw_and_leave(draw, icon, answer, complaints)
        _, status = os.waitpid(copy, 0)
        answer.seek(0)
        complaints.seek(0)
        wrong = "".join(line for line in complaints if NOISE not in line)
        assert not status and not wrong, f"drawing ended with status {status}\n{wrong}"
        return json.load(answer)


def _draw_and_leave(draw, icon: str, answer, complaints) -> None:
    signal.alarm(LIMIT)
    for stream in (1, 2):  # where Blender tells what is wrong with a layout, and goes on
        os.dup2(complaints.fileno(), stream)

    class TEST_PT_drawing(bpy.types.Panel):
        bl_label, bl_space_type, bl_region_type = "Drawing", "VIEW_3D", "UI"

        def draw(self, _context):
            said = []
            try:
                draw(Layout(self.layout, said, icon))
                json.dump(said, answer)
                answer.flush()
            except BaseException:
                traceback.print_exc()
            _write_out()
            os._exit(0)

    bpy.utils.register_class(TEST_PT_drawing)
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=None, region=None):
        bpy.ops.wm.call_panel(name=TEST_PT_drawing.__name__, keep_open=False)
    os._exit(1)


def _write_out() -> None:
    """What Python and Blender have said so far."""
    sys.stdout.flush()
    sys.stderr.flush()
    ctypes.CDLL(None).fflush(None)


class Layout:
    """A layout of Blender's that keeps the texts it is given."""

    def __init__(self, layout, said: list, icon: str):
        vars(self).update(_layout=layout, _said=said, _icon=icon)

    def __setattr__(self, name, value):
        setattr(self._layout, name, value)

    def __getattr__(self, name):
        asked = getattr(self._layout, name)
        if not callable(asked):
            return asked

        def recorded(*given, **options):
            result, text = asked(*given, **options), options.get("text", "")
            if name == "operator":
                assert result is not None, f"there is no operator {given[0]}"
                self._said.append(text or result.bl_rna.name)
            elif text and self._icon in options.get("icon", ""):
                self._said.append(text)
            return Layout(result, self._said, self._icon) if isinstance(result, bpy.types.UILayout) else result

        return recorded
