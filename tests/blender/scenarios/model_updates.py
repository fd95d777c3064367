# SPDX-License-Identifier: GPL-3.0-or-later
"""Live hair of a file that was saved when the add-on came with another model says so, until the file is saved again."""

from pathlib import Path

import bpy

from dcc_addon.interface.hair_notes import hair_notes
from dcc_addon.live.model_updates import NOTE
from tests.blender import scenes
from tests.blender.checks import MODEL, make_live


def another_shipped_model(folder: Path) -> None:
    """A file that is saved and opened again under the same model has no note; nor has hair with a model of its own."""
    rig = scenes.armature()
    scenes.dance(rig)
    make_live(rig, scenes.hair(rig, 20))
    _hair().model = ""
    path = str(folder / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    assert _hair().shipped and not _noted(path)
    for earlier in ("0123456789abcdef", ""):  # of another release, and of one that noted none
        _hair().shipped = earlier
        saved = bpy.app.handlers.save_pre
        kept = saved[:]
        saved.clear()
        bpy.ops.wm.save_as_mainfile(filepath=path)
        saved.extend(kept)
        assert _noted(path)
        _hair().model = str(MODEL)
        assert NOTE not in hair_notes(bpy.data.objects["Hair"], bpy.context.scene)
        _hair().model = ""
        bpy.ops.wm.save_as_mainfile(filepath=path)
        assert not _noted(path)


def _noted(path: str) -> bool:
    bpy.ops.wm.open_mainfile(filepath=path)
    return NOTE in hair_notes(bpy.data.objects["Hair"], bpy.context.scene)


def _hair():
    return bpy.data.objects["Hair"].neuralocks_hair
