# SPDX-License-Identifier: GPL-3.0-or-later
"""Which hair of a character is baked, and what is told of it."""

from pathlib import Path
from unittest import SkipTest
from unittest.mock import patch

import bpy
import numpy as np
from pxr import Usd, UsdGeom

from dcc_addon.scene.hair import curves
from dcc_addon.session import session
from tests.blender import scenes
from tests.blender.checks import MODEL, SAME, apart, baked_points, make_live, points_at, refused, told_by


def too_little_hair(folder: Path) -> None:
    """Hair without strands, or with strands of one point, is refused before anything is sampled, by all long operations; if there
    is other hair, empty hair is left out.
    """
    if "add_curves" not in bpy.types.Curves.bl_rna.functions:
        raise SkipTest("scripts make no curves in this Blender")
    operators, scene, rig = bpy.ops.neuralocks, bpy.context.scene, scenes.armature()
    scenes.dance(rig)
    scene.neuralocks.armature, scene.neuralocks.output = rig, str(folder / "hair.usdc")
    empty = _hair(rig, "Empty", bpy.data.hair_curves.new("Empty"))
    for hair, fact in ((empty, "no strands"), (_dots(rig), "one point only")):
        scene.neuralocks.hair = hair
        with patch("dcc_addon.operators.bake.sampling", side_effect=AssertionError("it was sampled")):
            for begin in (operators.bake, operators.bake_attach, operators.report_card):
                hair.neuralocks_hair.armature = rig
                refused(begin, hair.name, fact)
        with patch("dcc_addon.operators.training.sampling", side_effect=AssertionError("it was sampled")):
            refused(operators.train, hair.name, fact)
        assert not list(folder.glob("*.usdc")) and not hair.modifiers
        hair.neuralocks_hair.armature = None
    strands = scenes.hair(rig, 20)
    make_live(rig, strands)
    empty.neuralocks_hair.armature = rig
    told = told_by(operators.bake)
    assert any("Empty" in line and line.endswith("(left out)") for line in told), told
    assert apart(baked_points(folder / "hair.usdc", "/Character/Hair_Hair", 9), points_at(strands, 9)) < SAME


def hidden_in_renders(folder: Path) -> None:
    """A backup of the groom that no render draws is invisible in the file, with a note; one that cannot be baked does not stop the
    bake. Hair whose visibility is keyed is drawn, and so is hair that is baked alone by choice.
    """
    rig, scene = scenes.armature(), bpy.context.scene
    scenes.dance(rig)
    strands, backup = scenes.hair(rig, 20), scenes.hair(rig, 20, name="Backup")
    backup.neuralocks_hair.model = MODEL
    make_live(rig, strands)
    out = folder / "hair.usdc"
    scene.neuralocks.output, scene.neuralocks.hair = str(out), backup
    assert not [line for line in told_by(bpy.ops.neuralocks.bake) if "Backup" in line]
    assert _drawn(out) == {"Hair_Hair", "Hair_Backup"}
    old = bpy.data.collections.new("Old")
    scene.collection.children.link(old)
    old.objects.link(backup)
    scene.collection.objects.unlink(backup)
    layer = bpy.context.view_layer.layer_collection.children["Old"]
    for holder, setting in ((backup, "hide_render"), (old, "hide_render"), (layer, "exclude")):
        setattr(holder, setting, True)
        told = told_by(bpy.ops.neuralocks.bake)
        assert any(line.startswith("Backup: it is hidden in renders") for line in told), (setting, told)
        assert _drawn(out) == {"Hair_Hair"}
        setattr(holder, setting, False)
    backup.hide_render = True
    assert bpy.ops.neuralocks.report_card() == {"FINISHED"}
    if getattr(bpy.app.build_options, "usd", False):
        assert bpy.ops.neuralocks.bake_attach(filepath=str(folder / "alone.usdc")) == {"FINISHED"}
        assert _drawn(folder / "alone.usdc") == {"Hair_Backup"}
    curves.write(backup.data, np.full((len(backup.data.points), 3), np.nan, np.float32))
    told = told_by(bpy.ops.neuralocks.bake)
    assert any(line.startswith("Backup: some points are not finite") for line in told), told
    assert _drawn(out) == {"Hair_Hair"}
    backup.keyframe_insert("hide_render", frame=3)
    refused(bpy.ops.neuralocks.bake, "Backup: some points are not finite")


def numbered_by_name(folder: Path) -> None:
    """With hair of two looks, each keeps its numbered file, to which other scenes may refer, whatever its sliders say."""
    rig = scenes.armature()
    scenes.dance(rig)
    scenes.hair(rig, 5, name="Scalp").neuralocks_hair.model = MODEL
    beard = scenes.hair(rig, 5, name="Beard")
    beard.neuralocks_hair.model = MODEL
    bpy.context.scene.neuralocks.armature = rig
    for bend in (0.5, 2.0):
        beard.neuralocks_hair.bend = bend
        assert bpy.ops.neuralocks.bake(filepath=str(folder / "hair.usdc")) == {"FINISHED"}
        for number, name in enumerate(("Beard", "Scalp"), 1):
            assert _drawn(folder / f"hair_{number}.usdc") == {f"Hair_{name}"}, bend


def told_of_a_bake(folder: Path) -> None:
    """What a bake has to say is reported, with the names of objects and without options of a terminal."""
    rig, scene = scenes.armature("Hero"), bpy.context.scene
    scenes.dance(rig)
    rig.delta_location = (0, 0, 0)
    for frame, aside in ((1, 0), (12, 0), (13, 3), (24, 3)):
        rig.delta_location = (aside, 0, 0)
        rig.keyframe_insert("delta_location", frame=frame)
    strands = scenes.hair(rig, 20, name="前髪")
    make_live(rig, strands)
    first = np.array([point.position for point in strands.data.points])
    first[24:48] = first[24]
    strands.neuralocks_hair.live = False
    curves.write(strands.data, first.astype(np.float32))
    scene.neuralocks.output = str(folder / "hair.usdc")
    told = told_by(bpy.ops.neuralocks.bake)
    for begin, words in (("Hero: its head jumps to another place at 13", "anew"), ("前髪: 1 of 20 strands", "rigidly")):
        assert any(line.startswith(begin) and words in line for line in told), told
    assert not any("/Character" in line or "--" in line for line in told), told
    assert bpy.ops.neuralocks.report_card() == {"FINISHED"}
    card = session.said.cards[strands.name_full]
    assert any(line.startswith("前髪: 1 of 20 strands") for line in card), card
    assert not any("/Character" in line or "--" in line for line in card), card


def _drawn(path: Path) -> set[str]:
    """Names of the grooms of a file that are not invisible."""
    stage = Usd.Stage.Open(str(path))
    grooms = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.BasisCurves)]
    return {prim.GetName() for prim in grooms if UsdGeom.Imageable(prim).ComputeVisibility() != "invisible"}


def _hair(rig, name: str, data):
    hair = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(hair)
    hair.parent, hair.neuralocks_hair.model = rig, MODEL
    return hair


def _dots(rig):
    """Curves of one point each."""
    return _hair(rig, "Dots", curves.create("Dots", np.full(5, 1), np.zeros((5, 3), np.float32)))
