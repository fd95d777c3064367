# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair that Blender has imported with its motion, in the shape of a moved frame."""

from pathlib import Path
from unittest import SkipTest

import bpy

from dcc_addon.scene.hair import curves
from tests.blender import scenes
from tests.blender.checks import SAME, apart, baked_points, make_live, messages, needs_usd, points_at, refused, told_by
from tests.blender.panel import drawn


def imported_moving(folder: Path) -> None:
    """Hair of a character that was imported with its motion, whose curves have the shape of a moved frame, is told so; hair that plays a cache
    of this add-on has its rest shape.
    """
    rig, strands = scenes.dancer(20)
    for name, told in (("Neuralocks Cache", False), ("MeshSequenceCache", True)):
        if strands.modifiers.new(name, "MESH_SEQUENCE_CACHE") is None:
            raise SkipTest("hair has no modifiers in this Blender")
        make_live(rig, strands)
        for live in (True, False):
            strands.neuralocks_hair.live = live
            assert ("the shape of a moved frame" in " ".join(drawn())) == told, name
    if getattr(bpy.app.build_options, "usd", False):
        notes = told_by(bpy.ops.neuralocks.bake, filepath=str(folder / "hair.usdc"))
        assert [note for note in notes if note.startswith("Hair: 'MeshSequenceCache' may have left it in the shape")], (
            notes
        )


def imported_from_is_kept(folder: Path) -> None:
    """A bake to the file, or to the shot, from which something was imported is written beside it: what plays it stays as it is."""
    needs_usd()
    operators, rig, out = bpy.ops.neuralocks, scenes.armature(), folder / "anna_hair.usdc"
    scenes.dance(rig)
    make_live(rig, scenes.hair(rig, 20))
    assert operators.bake(filepath=str(out)) == {"FINISHED"}
    shot = folder / "anna_hair_shot.usdc"
    for source in (out, shot):
        scenes.empty()
        bpy.ops.wm.usd_import(filepath=str(source))
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "anna.blend"))  # the panel's output is beside it
        rig, strands = (next(o for o in bpy.data.objects if o.type == kind) for kind in ("ARMATURE", "CURVES"))
        make_live(rig, strands)
        before, live = (out.read_bytes(), shot.read_bytes()), points_at(strands, 9)
        for bake in (operators.bake_attach, operators.bake):
            assert bake() == {"FINISHED"}
            assert (out.read_bytes(), shot.read_bytes()) == before, source
            assert apart(points_at(strands, 9), live) < SAME, source
        for made in set(folder.glob("*.usdc")) - {out, shot}:
            made.unlink()


def rest_from_file(folder: Path) -> None:
    """Hair that Blender imported from a bake gets the rest shape of its file, and is then live as it was baked, saved, undone and
    redone with it; hair that was edited since the import keeps its edits.
    """
    needs_usd()
    operators, rig, scene = bpy.ops.neuralocks, scenes.armature(), bpy.context.scene
    scene.frame_start, scene.frame_end = -5, 24
    scenes.dance(rig, (-8, 25))
    scenes.body(rig)
    strands = scenes.hair(rig, 20)
    rest, out = curves.points(strands.data), str(folder / "hair.usdc")
    make_live(rig, strands)
    refused(operators.rest_from_file, "Hair: no modifier of it names a USD file")
    assert operators.bake(filepath=out) == {"FINISHED"}
    baked = baked_points(out, "/Character/Hair_Hair", 9)

    def imported():
        scenes.empty()
        bpy.ops.wm.usd_import(filepath=out)
        rig, strands = (next(o for o in bpy.data.objects if o.type == kind) for kind in ("ARMATURE", "CURVES"))
        return rig, strands

    rig, strands = imported()
    moved = curves.points(strands.data)
    assert apart(moved, rest) > 0.01, "Blender imports the rest shape by now"
    make_live(rig, strands)
    assert apart(points_at(strands, 9), baked) > 1e-3 and "press Rest Shape from File" in " ".join(drawn())
    bpy.ops.ed.undo_push(message="live")
    assert operators.rest_from_file() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="at rest")
    assert apart(points_at(strands, 9), baked) < 1e-4 and not messages(), messages()
    assert "moved frame" not in " ".join(drawn())
    for step, at_rest in ((bpy.ops.ed.undo, False), (bpy.ops.ed.redo, True)):
        step()
        strands = bpy.data.objects["Hair_Hair"]
        assert (apart(curves.points(strands.data), rest) < 1e-6) == at_rest
        assert ("moved frame" not in " ".join(drawn())) == at_rest
    assert apart(points_at(strands, 9), baked) < 1e-4 and not messages(), messages()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    strands = bpy.data.objects["Hair_Hair"]
    strands.neuralocks_hair.live = False
    assert apart(curves.points(strands.data), rest) < 1e-6 and "moved frame" not in " ".join(drawn())

    for live in (False, True):
        rig, strands = imported()
        moved[5, 2] += 0.001
        curves.write(strands.data, moved)
        make_live(rig, strands)
        strands.neuralocks_hair.live = live
        refused(operators.rest_from_file, strands.name, "hair.usdc", "edited since", "import the groom at rest")
        strands.neuralocks_hair.live = False
        assert apart(curves.points(strands.data), moved) == 0, "an edit is lost"
