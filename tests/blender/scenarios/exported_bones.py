# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair bones written for other programs."""

from pathlib import Path
from types import SimpleNamespace

import bpy

from tests.blender import scenes
from tests.blender.checks import give_bone_model, refused


def headers_of_two(folder: Path) -> None:
    """A header belongs to the character shown and has its name, so that it does not replace another's; if the model is another
    rig's, such as the example's, no header is written.
    """
    scene, folder = bpy.context.scene, folder / "here"
    folder.mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "two.blend"))
    for name in ("Anna", "Bert*"):
        scene.neuralocks.armature = rig = scenes.armature(name, bones=scenes.BONES + scenes.TAIL)
        refused(bpy.ops.neuralocks.export_c, "hair", "Train for This Character")
        assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
        rig.neuralocks_character.rig_model = str(scenes.rig_model(rig, folder / f"{name[0]}.neuralocks"))
        assert bpy.ops.neuralocks.export_c() == {"FINISHED"}
    headers = ["Anna_hair.h", "Anna_hair_example.c", "Bert__hair.h", "Bert__hair_example.c"]
    assert sorted(p.name for p in folder.glob("*_hair*")) == headers, list(folder.iterdir())


def told_of_the_export(folder: Path) -> None:
    """Notes on exported hair bones are reported, about the character and in the panel's words."""
    from dcc_addon.operators.rig import NEURALOCKS_OT_export_skel

    rig, said = scenes.armature(bones=scenes.BONES + scenes.TAIL), []
    scenes.dance(rig)
    give_bone_model(rig, folder)
    rig.neuralocks_character.loop = True
    told = SimpleNamespace(filepath=str(folder / "rig.usdc"), report=lambda kind, text: said.append((*kind, text)))
    for _ in NEURALOCKS_OT_export_skel.steps(told, bpy.context):
        pass
    (first, ended), *notes = said
    assert first == "INFO" and ended.startswith("Rig: hair bones written to"), said
    assert notes and all(kind == "WARNING" and "--" not in text for kind, text in notes), notes
    assert any(text.startswith("Rig: bone '") and "a loop must end" in text for _, text in notes), notes


def export_cancelled(folder: Path) -> None:
    """While bones are baked for another program, Blender takes events, and Esc leaves nothing behind."""
    from dcc_addon.operators.rig import NEURALOCKS_OT_export_skel

    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig)
    give_bone_model(rig, folder)
    out = folder / "new" / "rig.usdc"
    steps = NEURALOCKS_OT_export_skel.steps(SimpleNamespace(filepath=str(out)), bpy.context)
    assert any("Baking" in message for _, _, message in steps) and out.parent.exists()
    steps.close()
    assert not out.parent.exists()
