# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts in a sidebar of some width."""

from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import bpy

from tests.blender.panel import shown

TEXT = "The head is 18 m wide; check the scene's Unit Scale or the armature's scale"


def texts_fit_the_sidebar(_folder: Path) -> None:
    """In this Blender's font: a wider sidebar needs fewer lines, and an almost closed one does not get a line per letter."""
    from dcc_addon.interface import labels

    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0), ui_styles=bpy.context.preferences.ui_styles)
    counts = []
    for width in (30, 260, 400, 2000):
        context = SimpleNamespace(region=SimpleNamespace(width=width), preferences=preferences)
        with patch.object(labels, "bpy", SimpleNamespace(context=context)):
            said = shown(lambda layout: labels.words(layout, TEXT, "INFO"))
        assert " ".join(said).replace("\u00a0", " ") == TEXT
        counts.append(len(said))
    assert counts == sorted(counts, reverse=True) and counts[0] < 15 and counts[-1] == 1, counts
    assert 2 < counts[1] < 6, counts
