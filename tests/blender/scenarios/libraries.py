# SPDX-License-Identifier: GPL-3.0-or-later
"""Data of other files: linked, overridden, instanced, appended."""

import contextlib
import shutil
from pathlib import Path
from unittest import SkipTest

import bpy

from tests.blender import scenes
from tests.blender.checks import MODEL, SAME, apart, choose, make_live, messages, needs_usd, points_at, refused


def linked(folder: Path) -> None:
    """A linked character: clear words; an override plays its bake; local curves are live; nothing is lost."""
    needs_usd()
    _character_library(folder)
    scenes.empty()
    with bpy.data.libraries.load(str(folder / "library.blend"), link=True) as (_, wanted):
        wanted.collections = ["Character"]
    scene = bpy.context.scene
    scene.collection.children.link(bpy.data.collections["Character"])
    rig, strands = bpy.data.objects["Rig"], bpy.data.objects["Hair"]
    groomed = points_at(strands, 1)
    make_live(rig, strands)
    points_at(strands, 9)
    message = next(text for name, text in messages().items() if "Hair" in name)
    assert "linked" in message and "Make Local" in message, messages()
    strands.neuralocks_hair.live = False
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "linked.usdc")) == {"FINISHED"}
    # Changes to linked data are not saved.
    refused(bpy.ops.neuralocks.bake_attach, "linked from library.blend")
    refused(bpy.ops.neuralocks.assign, "linked from library.blend")
    refused(bpy.ops.neuralocks.train, "linked from library.blend")
    refused(lambda: bpy.ops.neuralocks.train(kind="rig"), "linked from library.blend")
    refused(bpy.ops.neuralocks.reset_look, "linked from library.blend")
    strands.neuralocks_hair.armature = None
    refused(bpy.ops.neuralocks.find, "linked from library.blend")
    assert strands.neuralocks_hair.armature is None
    assert not strands.modifiers
    assert apart(points_at(strands, 1), groomed) < 1e-6

    bpy.data.libraries[0].reload()  # drop what only this script could set on it
    bpy.data.collections["Character"].override_hierarchy_create(scene, bpy.context.view_layer, do_fully_editable=True)
    rig, strands = (
        next(o for o in bpy.data.objects if o.type == kind and not o.library) for kind in ("ARMATURE", "CURVES")
    )
    choose(None)
    assert any(thing.library for thing in scene.objects) and bpy.ops.neuralocks.find() == {"FINISHED"}
    assert (scene.neuralocks.armature, scene.neuralocks.hair) == (rig, strands)
    strands.neuralocks_hair.armature, strands.neuralocks_hair.model = rig, MODEL
    strands.neuralocks_hair.bend, rig.neuralocks_character.head_bone = 2.5, "head"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "override.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "override.blend"))
    scene = bpy.context.scene
    rig, strands = (
        next(o for o in bpy.data.objects if o.type == kind and not o.library) for kind in ("ARMATURE", "CURVES")
    )
    assert (strands.neuralocks_hair.bend, rig.neuralocks_character.head_bone) == (2.5, "head"), "not saved"
    assert (strands.neuralocks_hair.armature, strands.neuralocks_hair.model) == (rig, MODEL)
    strands.neuralocks_hair.bend = 1.0
    assert bpy.ops.neuralocks.bake_attach(filepath=str(folder / "cache.usdc")) == {"FINISHED"}
    played = points_at(strands, 9)
    assert apart(played, scenes.points(bpy.data.objects["Hair", str(bpy.data.libraries[0].filepath)])) > 0.01
    assert bpy.ops.neuralocks.detach() == {"FINISHED"}
    strands.make_local()
    strands.data.make_local()
    make_live(rig, strands)
    assert apart(points_at(strands, 9), played) < SAME
    assert not messages(), messages()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    strands = next(o for o in bpy.data.objects if o.type == "CURVES" and not o.library)
    assert strands.neuralocks_hair.live and "neuralocks_rest" not in strands.data.attributes


def not_found(folder: Path) -> None:
    """Local hair on a character whose library is not there when the shot is opened says so, and moves again when it is back."""
    if "is_missing" not in bpy.types.ID.bl_rna.properties:
        raise SkipTest("this Blender does not tell what is missing")
    _character_library(folder)
    library, shot = folder / "library.blend", str(folder / "shot.blend")
    scenes.empty()
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.objects = ["Rig"]
    rig = bpy.data.objects["Rig"]
    bpy.context.scene.collection.objects.link(rig)
    strands = scenes.hair(rig, 20)
    make_live(rig, strands)
    shown = points_at(strands, 9)
    bpy.ops.wm.save_as_mainfile(filepath=shot)

    library.rename(folder / "elsewhere.blend")
    with contextlib.suppress(RuntimeError):  # Blender reports it
        bpy.ops.wm.open_mainfile(filepath=shot)
    points_at(bpy.data.objects["Hair"], 9)
    assert "library.blend was not found" in messages()["Hair"], messages()
    refused(bpy.ops.neuralocks.sample_motion, "library.blend was not found")
    bpy.ops.wm.save_mainfile()

    (folder / "elsewhere.blend").rename(library)
    bpy.ops.wm.open_mainfile(filepath=shot)
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    assert apart(points_at(bpy.data.objects["Hair"], 9), shown) < SAME and not messages(), messages()


def instanced(folder: Path) -> None:
    """A character that is a collection instance: the message says so, and each remedy that it names works."""
    _character_library(folder)

    def instance(link: bool):
        scenes.empty()
        with bpy.data.libraries.load(str(folder / "library.blend"), link=link) as (_, wanted):
            wanted.collections = ["Character"]
        holder = bpy.data.objects.new("Instance", None)
        holder.instance_type, holder.instance_collection = "COLLECTION", bpy.data.collections["Character"]
        bpy.context.scene.collection.objects.link(holder)
        bpy.context.view_layer.objects.active = holder
        return holder

    def override():
        bpy.ops.object.make_override_library()

    def make_real():
        bpy.ops.object.duplicates_make_real(use_base_parent=True, use_hierarchy=True)

    for link, remedy, words in (
        (True, override, ("of library.blend", "Library Override")),
        (True, make_real, ("of library.blend", "Make Instances Real")),
        (False, make_real, ("'Character',", "Make Instances Real")),
    ):
        holder = instance(link)
        refused(bpy.ops.neuralocks.find, "Instance", "instance of the collection 'Character'", *words)
        other = scenes.armature("Other")
        assert bpy.ops.neuralocks.find() == {"FINISHED"} and bpy.context.scene.neuralocks.armature == other
        bpy.ops.object.select_all(action="DESELECT")
        holder.select_set(True)
        refused(bpy.ops.neuralocks.find, "Instance", *words)
        bpy.data.objects.remove(other)
        bpy.context.view_layer.objects.active = holder
        remedy()
        assert bpy.ops.neuralocks.find() == {"FINISHED"}
        settings, here = bpy.context.scene.neuralocks, bpy.context.scene.objects
        assert settings.armature.name in here and settings.hair.name in here
        assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}


def beside_the_file(folder: Path) -> None:
    """A model named with // is beside the file in which it was named: the library of linked and overridden hair, and where
    this file was before it was saved in another folder; a copy there changes nothing here.
    """
    from dcc_addon.live.models import model_path

    library, shots = folder / "library", folder / "shots"
    library.mkdir()
    shots.mkdir()
    model = shutil.copy(MODEL, library / "mine.neuralocks")
    rig, strands = scenes.dancer(20)
    make_live(rig, strands)
    bpy.ops.wm.save_as_mainfile(filepath=str(library / "library.blend"))
    strands.neuralocks_hair.model = "//mine.neuralocks"
    shown = points_at(strands, 9)
    bpy.ops.wm.save_as_mainfile(filepath=str(shots / "copy.blend"), copy=True)
    assert strands.neuralocks_hair.model == "//mine.neuralocks"
    bpy.ops.wm.save_mainfile()
    if bpy.app.version >= (4, 0):  # older ones do not say where a file will be saved
        bpy.ops.wm.save_as_mainfile(filepath=str(shots / "moved.blend"))
        assert apart(scenes.points(strands), shown) < 1e-6 and not messages(), messages()
        for name in ("copy", "moved"):
            bpy.ops.wm.open_mainfile(filepath=str(shots / f"{name}.blend"))
            strands = bpy.data.objects["Hair"]
            assert strands.neuralocks_hair.model == "//../library/mine.neuralocks", strands.neuralocks_hair.model
            assert Path(model_path(strands)).samefile(model)

    scenes.empty()
    bpy.ops.wm.save_as_mainfile(filepath=str(shots / "shot.blend"))
    with bpy.data.libraries.load(str(library / "library.blend"), link=True) as (_, wanted):
        wanted.objects = ["Hair"]
    strands = bpy.data.objects["Hair"]
    assert Path(model_path(strands)).samefile(model)
    strands = strands.override_create()
    assert Path(model_path(strands)).samefile(model)
    strands.neuralocks_hair.model = "//other.neuralocks"
    refused(lambda: model_path(strands), str(shots / "other.neuralocks"), "beside this file")
    shutil.copy(MODEL, shots / "other.neuralocks")
    assert Path(model_path(strands)) == shots / "other.neuralocks"


def written_by_a_script(folder: Path) -> None:
    """Hair that a script wrote into a library while Live was on is at rest if appended, and says so if linked."""
    from dcc_addon.scene.hair import curves

    file = str(folder / "library.blend")
    rig, strands = scenes.dancer(20)
    groom = curves.points(strands.data)
    make_live(rig, strands)
    points_at(strands, 9)
    bpy.data.libraries.write(file, {rig, strands})
    for link in (False, True):
        scenes.empty()
        with bpy.data.libraries.load(file, link=link) as (_, wanted):
            wanted.objects = ["Rig", "Hair"]
        for thing in wanted.objects:
            bpy.context.scene.collection.objects.link(thing)
        bpy.context.scene.neuralocks.armature, strands = wanted.objects
        assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
        points_at(strands, 9)
        assert apart(curves.points(strands.data), groom) == 0.0
        if link:
            assert "save that file" in messages()[strands.name_full], messages()
        else:
            assert not messages(), messages()
            strands.neuralocks_hair.live = False
            assert apart(curves.shown(strands.data), groom) == 0.0


def appended(folder: Path) -> None:
    """Appended hair finds the model beside its own file, if Blender reports that file; hair that is made local says where the model
    was looked for, and where it is.
    """
    from dcc_addon.live.models import model_path

    library, shots = folder / "library", folder / "shots"
    library.mkdir()
    shots.mkdir()
    model = shutil.copy(MODEL, library / "mine.neuralocks")
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    strands = scenes.hair(rig, 20)
    strands.neuralocks_hair.model = rig.neuralocks_character.rig_model = "//mine.neuralocks"
    bpy.ops.wm.save_as_mainfile(filepath=str(library / "library.blend"))

    def bring(link: bool):
        with bpy.data.libraries.load(str(library / "library.blend"), link=link) as (_, wanted):
            wanted.objects = ["Hair"]
        return bpy.data.objects["Hair"]

    for saved in (True, False):
        scenes.empty()
        if saved:
            bpy.ops.wm.save_as_mainfile(filepath=str(shots / "shot.blend"))
        strands = bring(link=False)
        if hasattr(bpy.app.handlers, "blend_import_post"):
            named = "//../library/mine.neuralocks" if saved else str(model)
            assert strands.neuralocks_hair.model == named, strands.neuralocks_hair.model
            assert Path(model_path(strands)).samefile(model)
            assert Path(model_path(strands.neuralocks_hair.armature, "rig")).samefile(model)
        elif saved:
            refused(lambda strands=strands: model_path(strands), str(shots / "mine.neuralocks"), str(model))

    bpy.ops.wm.open_mainfile(filepath=str(shots / "shot.blend"))
    strands = bring(link=True)
    assert Path(model_path(strands)).samefile(model)
    bpy.context.scene.collection.objects.link(strands)
    strands.make_local()
    strands = next(o for o in bpy.data.objects if o.type == "CURVES" and o.library is None)
    refused(lambda: model_path(strands), str(shots / "mine.neuralocks"), "beside library.blend", str(model))


def of_one_name(folder: Path) -> None:
    """What was taken out of the scene is not taken for what another file has under its name, and is in the scene."""
    _character_library(folder)
    scenes.empty()
    with bpy.data.libraries.load(str(folder / "library.blend"), link=True) as (_, wanted):
        wanted.collections = ["Character"]
    scene = bpy.context.scene
    scene.collection.children.link(bpy.data.collections["Character"])
    linked, strands = (next(o for o in scene.objects if o.type == kind) for kind in ("ARMATURE", "CURVES"))
    rig, own = linked.copy(), strands.copy()
    assert (rig.name, own.name) == ("Rig", "Hair") and not rig.library and not own.library
    out = str(folder / "hair.usdc")
    scene.neuralocks.armature, scene.neuralocks.hair = linked, own
    refused(bpy.ops.neuralocks.report_card, "no hair chosen")
    scene.collection.objects.link(own)
    assert bpy.ops.neuralocks.report_card() == {"FINISHED"} and bpy.ops.neuralocks.bake(filepath=out) == {"FINISHED"}
    scene.neuralocks.armature = own.neuralocks_hair.armature = rig
    refused(bpy.ops.neuralocks.sample_motion, "no armature chosen")
    scene.collection.objects.link(rig)
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}


def _character_library(folder: Path) -> None:
    """A file `library.blend` with a collection `Character`: a dancing armature with hair."""
    rig = scenes.armature()
    scenes.dance(rig)
    scenes.hair(rig, 20)
    scenes.collect("Character")
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "library.blend"))
