# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panels say, without the window that Blender draws them in."""

from types import SimpleNamespace

import bpy


def drawn(icon: str = "") -> list[str]:
    """Everything that the panels and the menu say now; what stands beside this icon, if one is given."""
    from dcc_addon import menu, panels

    said = []
    for cls in (*panels.CLASSES, *menu.CLASSES):
        cls.draw(SimpleNamespace(layout=Layout(said, icon)), bpy.context)
    return said


class Layout:
    """Stands in for Blender's layout, which only a window has: what it is asked for must exist in this Blender."""

    def __init__(self, said: list, icon: str = ""):
        self.said, self.icon = said, icon

    def __getattr__(self, name):
        if name not in bpy.types.UILayout.bl_rna.functions:
            raise AttributeError(name)
        known = bpy.types.UILayout.bl_rna.functions[name].parameters

        def asked(*given, **options):
            assert set(options) <= set(known.keys()), (name, options)
            if name in ("prop", "prop_search"):
                assert given[1] in given[0].bl_rna.properties, given
            if name == "operator":
                described = getattr(bpy.ops.neuralocks, given[0].split(".")[1]).get_rna_type()
                self.said.append(options.get("text", described.name))
                return SimpleNamespace(**dict.fromkeys(described.properties.keys()))
            if options.get("text") and self.icon in options.get("icon", ""):
                self.said.append(options["text"])
            return Layout(self.said, self.icon)

        return asked
