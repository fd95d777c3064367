# SPDX-License-Identifier: GPL-3.0-or-later
"""What was set otherwise since hair was baked, or of another shape: the panel names it, as long as it is so."""

import shutil
from pathlib import Path
from unittest import SkipTest

import bpy

from dcc_addon.scene.baked import groom_record
from tests.blender import scenes
from tests.blender.checks import MODEL, SAME, apart, bones_at, choose, give_bone_model, make_live, needs_usd
from tests.blender.panel import told_changed


def character_set_since(folder: Path) -> None:
    """If the Loop, Head Bone, its rest place, unit scale or body of attached hair becomes another, a note says so until it is as before, also when the
    file is opened again.
    """
    needs_usd()
    rig, strands = scenes.dancer(20, skinned=True)
    make_live(rig, strands)
    body, scene = bpy.data.objects["Body"], bpy.context.scene
    fat = _fatten(body)
    breathing = _fatten(body, "Breath")
    for frame in (1, 24):
        breathing.value = frame / 24
        breathing.keyframe_insert("value", frame=frame)
    scene.neuralocks.output = str(folder / "hair.usdc")
    assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"} and not told_changed()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    strands, body, scene = (*map(bpy.data.objects.get, ("Hair", "Body")), bpy.context.scene)
    own, mesh = strands.neuralocks_hair.armature.neuralocks_character, body.data
    fat, (curve,) = mesh.shape_keys.key_blocks["Fat"], scenes.fcurves(mesh.shape_keys)
    assert not told_changed()
    basis = mesh.shape_keys.reference_key.data
    slim = [point.co.copy() for point in basis]

    def widen(wide: bool) -> None:
        for point, before in zip(basis, slim, strict=True):
            point.co = before * (1.3 if wide else 1.0)

    def breathe(deeply: bool) -> None:
        curve.keyframe_points[1].co.y = 2.0 if deeply else 1.0
        mesh.shape_keys.animation_data.action.update_tag()

    def lower(on: bool) -> None:
        choose(own.id_data)
        bpy.ops.object.mode_set(mode="EDIT")
        own.id_data.data.edit_bones["head"].head.z = 1.54 if on else 1.55
        bpy.ops.object.mode_set(mode="OBJECT")

    changes = {
        "Loop": [lambda on: setattr(own, "loop", on)],
        "Head Bone or its rest place": [lambda on: setattr(own, "head_bone", "neck" if on else ""), lower],
        "Unit Scale": [lambda on: setattr(scene.unit_settings, "scale_length", 0.5 if on else 1.0)],
        "body": [
            lambda on: setattr(body, "hide_render", on),
            lambda on: setattr(fat, "value", float(on)),
            widen,
            breathe,
        ],
    }
    assert not groom_record.changed(strands, scene)  # what it keeps for later drawings, those of the tests lose
    for what, edits in changes.items():
        for edit in edits:
            for on in (True, False):
                edit(on)
                assert told_changed() == ([what] if on else []), (what, edits.index(edit), on, told_changed())
    if bpy.app.version >= (4, 0):  # without a window, older ones keep no undo steps
        assert bpy.ops.ed.undo_push(message="before") == {"FINISHED"}
        own.loop, fat.value = True, 1.0
        assert bpy.ops.ed.undo_push(message="after") == {"FINISHED"} and told_changed() == ["Loop", "body"]
        assert bpy.ops.ed.undo() == {"FINISHED"} and not told_changed()
        strands, body, scene = (*map(bpy.data.objects.get, ("Hair", "Body")), bpy.context.scene)
        own, mesh = strands.neuralocks_hair.armature.neuralocks_character, body.data
        fat = mesh.shape_keys.key_blocks["Fat"]
    own.head_bone, own.body = "head", body
    body.name, fat.name, mesh.name = "Skin", "Thick", "Skin"
    assert not told_changed(), "chosen is what was found, and a name is no shape"
    for frame in (3, 9):
        scene.frame_set(frame)
        assert not told_changed(), "the cache shows what is keyed"
    others = [each for each in scene.collection.objects if each.type == "MESH"]
    for each in others:
        scene.collection.objects.unlink(each)
    assert not told_changed(), "where hair was appended alone, nobody changed a body"
    for each in others:
        scene.collection.objects.link(each)
    body.vertex_groups[0].add(range(len(mesh.vertices)), 0.5, "REPLACE")
    assert told_changed() == ["body"]
    strands.location.x += 0.1
    assert told_changed() == ["place", "body"]
    assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"} and not told_changed()
    own.loop = True
    assert told_changed() == ["Loop"]


def model_moved_since(folder: Path) -> None:
    """Attached hair whose model is named from the file is told of another model, by what is in it, and not of a save in another folder."""
    needs_usd()
    shot, there, model = folder / "shot.blend", folder / "later", folder / "own.neuralocks"
    there.mkdir()
    shutil.copy(MODEL, model)
    rig, strands = scenes.dancer(20, skinned=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(shot))
    make_live(rig, strands)
    own, scene = strands.neuralocks_hair, bpy.context.scene
    own.live, own.model, scene.neuralocks.output = False, "//own.neuralocks", str(folder / "hair.usdc")
    assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"} and not told_changed()
    bpy.ops.wm.save_as_mainfile(filepath=str(there / "shot.blend"))
    assert own.model == "//../own.neuralocks" and not told_changed()
    bpy.ops.wm.open_mainfile(filepath=str(there / "shot.blend"))
    own = bpy.data.objects["Hair"].neuralocks_hair
    assert not told_changed()
    model.rename(folder / "away.neuralocks")
    assert not told_changed(), "a model that is missing here is no other one"
    (folder / "away.neuralocks").rename(model)
    own.resolve = not own.resolve
    assert told_changed() == ["sliders"]
    own.resolve = not own.resolve
    for other, what in (("", ["Model"]), (str(model), [])):
        own.model = other
        assert told_changed() == what


def keys_set_since(folder: Path) -> None:
    """If hair bones that have baked keys are set to another motion, or stand in another wind, a note says so until that is as before, the
    bones are live, or the keys are off or made anew. Keys without a record tell of nothing.
    """
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig)
    give_bone_model(rig, folder)
    operators, own, scene = bpy.ops.neuralocks, rig.neuralocks_character, bpy.context.scene
    assert operators.bake_keys() == {"FINISHED"} and not told_changed("Bake to Keyframes")
    (folder / "later").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    own.rig_model = "//rig.neuralocks"
    assert not told_changed("Bake to Keyframes")
    if bpy.app.version < (4, 0):
        raise SkipTest("this Blender does not tell where it saves to")
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "later" / "shot.blend"))
    assert not told_changed("Bake to Keyframes") and own.rig_model == "//../rig.neuralocks", "the same model"
    (folder / "rig.neuralocks").rename(folder / "away.neuralocks")
    assert not told_changed("Bake to Keyframes"), "a model that is missing here is no other one"
    (folder / "away.neuralocks").rename(folder / "rig.neuralocks")
    keyed, model = bones_at(rig, 9), own.rig_model
    settings = {
        "Motion": (own, "rig_motion", 0.5, 1.0),
        "Model": (own, "rig_model", "", model),
        "Chains": (own, "chains", "hair.01", ""),
        "wind": (own, "wind", 6.0, 0.0),
        "Loop": (own, "loop", True, False),
        "Head Bone or its rest place": (own, "head_bone", "neck", ""),
        "Unit Scale": (scene.unit_settings, "scale_length", 0.5, 1.0),
    }
    for what, (owner, name, other, before) in settings.items():
        for value in (other, before):
            setattr(owner, name, value)
            assert told_changed("Bake to Keyframes") == ([what] if value == other else [])
    own.rig_motion, own.wind, own.loop = 0.5, 6.0, True
    assert told_changed("Bake to Keyframes") == ["Motion", "wind", "Loop"] and apart(bones_at(rig, 9), keyed) == 0.0
    assert operators.sample_motion() == {"FINISHED"}
    own.rig_live = True
    assert not told_changed("Bake to Keyframes")
    live = bones_at(rig, 9)
    own.rig_live = False
    track = rig.animation_data.nla_tracks["Neuralocks Hair"]
    for mute in (True, False):
        track.mute = mute
        assert bool(told_changed("Bake to Keyframes")) != mute
    assert operators.bake_keys() == {"FINISHED"} and not told_changed("Bake to Keyframes")
    assert apart(bones_at(rig, 9), live) < SAME < apart(live, keyed)
    own.wind = 0.0
    assert told_changed("Bake to Keyframes") == ["wind"]
    del rig.animation_data.nla_tracks["Neuralocks Hair"].strips[0].action["neuralocks_keyed"]
    assert not told_changed("Bake to Keyframes")
    assert operators.remove_keys() == {"FINISHED"} and not told_changed("Bake to Keyframes")


def _fatten(body, name: str = "Fat"):
    """A shape key that makes the head wide."""
    if body.data.shape_keys is None:
        body.shape_key_add(name="Basis")
    key = body.shape_key_add(name=name)
    for point in key.data:
        if point.co.z > 1.5:
            point.co.x *= 1.4
    key.value = 0.0
    return key


def body_edited_since(folder: Path) -> None:
    """While a body is edited, the panel says what it said before; then, that it is another."""
    needs_usd()
    for keyed in (False, True):
        scenes.empty()
        rig, strands = scenes.dancer(20, skinned=True)
        make_live(rig, strands)
        body = bpy.data.objects["Body"]
        if keyed:
            _fatten(body).value = 1.0
        choose(body)
        bpy.context.scene.neuralocks.output = str(folder / "hair.usdc")
        assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"} and not told_changed()
        body.vertex_groups.new(name="pin").add([0, 1], 1.0, "REPLACE")  # of cloth, say: it moves nothing
        rig.data.bones["head"].name = "Skull"
        bpy.context.view_layer.update()
        assert not told_changed()
        rig.data.bones["Skull"].name = "head"
        for wide in (False, True):
            bpy.ops.object.mode_set(mode="EDIT")
            assert not told_changed()
            bpy.ops.mesh.select_all(action="SELECT")
            if wide:
                bpy.ops.transform.resize(value=(1.3, 1.0, 1.0))
            assert not told_changed()
            bpy.ops.object.mode_set(mode="OBJECT")
            assert told_changed() == (["body"] if wide else [])
        bpy.ops.object.mode_set(mode="EDIT")
        assert told_changed() == ["body"]
        bpy.ops.object.mode_set(mode="OBJECT")
