# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair that is copied and pasted."""

import shutil
from pathlib import Path
from unittest import SkipTest

import bpy

from tests.blender import scenes
from tests.blender.checks import MODEL


def pasted(folder: Path) -> None:
    """Hair and bones that are copied name the same models where they are pasted: in their file, in another, if Blender reports what it
    pastes there, also after their file was opened again or saved elsewhere. A file that was moved afterwards counts where it is.
    """
    shots, later, others, moved = (folder / name for name in ("shots", "later", "others", "moved"))
    for each in (shots, later, others):
        each.mkdir()
    model = Path(shutil.copy(MODEL, shots / "mine.neuralocks"))
    settings = bpy.context.preferences.filepaths
    before = settings.temporary_directory
    settings.temporary_directory = str(folder)  # where Blender puts what is copied
    rig = scenes.armature()
    strands = scenes.hair(rig, 20)
    bpy.ops.wm.save_as_mainfile(filepath=str(shots / "shot.blend"))
    strands.neuralocks_hair.model = rig.neuralocks_character.rig_model = "//mine.neuralocks"
    try:
        _copied(model)
        bpy.ops.wm.save_mainfile()
        _copied(model)
        if bpy.app.version >= (4, 0):  # without a window, older ones keep no undo steps
            assert bpy.ops.ed.undo_push(message="one") == bpy.ops.ed.undo_push(message="two") == {"FINISHED"}
            assert bpy.ops.ed.undo() == {"FINISHED"}
            _copied(model)
        bpy.ops.wm.open_mainfile(filepath=str(shots / "shot.blend"))
        _copied(model)
        if bpy.app.version < (4, 0):
            raise SkipTest("this Blender does not tell where it saves to")
        bpy.ops.wm.save_as_mainfile(filepath=str(later / "shot.blend"))
        assert bpy.data.objects["Hair"].neuralocks_hair.model == "//../shots/mine.neuralocks"
        _copied(model)
        if hasattr(bpy.app.handlers, "blend_import_post"):
            for target in (str(others / "other.blend"), ""):
                bpy.ops.wm.open_mainfile(filepath=str(shots / "shot.blend"))
                _copy()
                scenes.empty()
                if target:
                    bpy.ops.wm.save_as_mainfile(filepath=target)
                assert _pasted() == [model] * 2
    finally:
        settings.temporary_directory = before
    if hasattr(bpy.app.handlers, "blend_import_post"):
        shots.rename(moved)
        shots.mkdir()  # as if it were another shot's
        scenes.empty()
        with bpy.data.libraries.load(str(moved / "shot.blend")) as (_, wanted):
            wanted.objects = ["Hair"]
        assert _models(bpy.data.objects) == [moved / "mine.neuralocks"] * 2


def pasted_with_two_models(folder: Path) -> None:
    """What names models of both kinds names both where it is pasted: writing one path forgets no folder of the other."""
    if not hasattr(bpy.app.handlers, "blend_import_post"):
        raise SkipTest("this Blender does not report what it pastes")
    (shots := folder / "shots").mkdir()
    model = Path(shutil.copy(MODEL, shots / "mine.neuralocks"))
    settings = bpy.context.preferences.filepaths
    before = settings.temporary_directory
    settings.temporary_directory = str(folder)
    try:
        strands = scenes.hair(scenes.armature(), 20)
        bpy.ops.wm.save_as_mainfile(filepath=str(shots / "shot.blend"))
        strands.neuralocks_hair.model = strands.neuralocks_character.rig_model = "//mine.neuralocks"
        _copy()
        scenes.empty()
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "other.blend"))
        assert bpy.ops.view3d.pastebuffer() == {"FINISHED"}
    finally:
        settings.temporary_directory = before
    (hair,) = (thing for thing in bpy.context.selected_objects if thing.type == "CURVES")
    named = hair.neuralocks_hair.model, hair.neuralocks_character.rig_model
    assert [Path(bpy.path.abspath(path)).resolve() for path in named] == [model] * 2, named


def _copied(model: Path) -> None:
    """Copy what is in the file, and paste it there: all of it names the model."""
    _copy()
    assert _pasted() == [model] * 2 == _models(bpy.data.objects)[:2]
    for thing in list(bpy.context.selected_objects):
        bpy.data.objects.remove(thing)


def _copy() -> None:
    for thing in bpy.context.scene.objects:
        thing.select_set(True)
    assert bpy.ops.view3d.copybuffer() == {"FINISHED"}


def _pasted() -> list[Path]:
    """The models that what is pasted names."""
    assert bpy.ops.view3d.pastebuffer() == {"FINISHED"}
    return _models(bpy.context.selected_objects)


def _models(things) -> list[Path]:
    from dcc_addon.live.models import model_path

    kinds = {"CURVES": "strands", "ARMATURE": "rig"}
    return [Path(model_path(thing, kinds[thing.type])).resolve() for thing in things]
