# SPDX-License-Identifier: GPL-3.0-or-later
"""What cannot work is refused in plain words."""

from pathlib import Path
from unittest.mock import patch

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import MODEL, SAME, apart, baked_points, make_live, messages, points_at, refused


def bad_input(folder: Path) -> None:
    """Each is refused in plain words, without a traceback, and nothing is lost."""
    operators, scene = bpy.ops.neuralocks, bpy.context.scene
    refused(operators.find, "no armature")
    refused(operators.sample_motion, "no armature")
    refused(operators.bake, "no armature")
    refused(operators.from_particles, "particle system")
    headless = scenes.armature("Snake", (("a", "", (0, 0, 0), (0, 0, 1)), ("b", "a", (0, 0, 1), (0, 0, 2))))
    scene.neuralocks.armature = headless
    refused(operators.sample_motion, "Snake", "head")
    rig, strands = scenes.dancer(10)
    scene.neuralocks.armature, scene.neuralocks.hair = rig, strands
    own = strands.neuralocks_hair
    own.model = MODEL
    refused(lambda: operators.bake(filepath="//x.usdc"), "not saved")
    refused(lambda: operators.bake(filepath="/proc/nowhere/x.usdc"), "/proc/nowhere")

    assert operators.sample_motion() == {"FINISHED"}
    _bad_models(strands, folder)
    _no_strands(rig)
    operators.sample_motion()
    own.live = True
    rig.scale = (-1, 1, 1)
    refused(operators.sample_motion, "mirrored")
    rig.scale = (1, 1, 1)
    scene.frame_start = scene.frame_end = 4
    assert operators.sample_motion() == {"FINISHED"}
    assert operators.bake(filepath=str(folder / "one.usdc")) == {"FINISHED"}
    scene.frame_set(4)
    assert apart(baked_points(folder / "one.usdc", "/Character/Hair_Hair", 4), scenes.points(strands)) < SAME
    away = bpy.data.collections.new("Away")
    scene.collection.children.link(away)
    away.objects.link(rig)
    scene.collection.objects.unlink(rig)
    bpy.context.view_layer.layer_collection.children["Away"].exclude = True
    assert operators.sample_motion() == {"FINISHED"}, "what is excluded is still evaluated, as the hair depends on it"
    scene.frame_set(4)
    assert not messages(), messages()


def _bad_models(strands, folder: Path) -> None:
    """Models that are not there or damaged: hair stays as it was groomed."""
    scene, own = bpy.context.scene, strands.neuralocks_hair
    groomed = np.array([p.position for p in strands.data.points])
    (folder / "torn.neuralocks").write_bytes(Path(MODEL).read_bytes()[:5000])
    for path, word in (
        ("/nowhere.neuralocks", "no such"),
        (str(folder / "torn.neuralocks"), "damaged"),
        ("//m.neuralocks", "not saved"),
    ):
        own.model = path
        own.live = True
        scene.frame_set(7)
        assert word in messages()["Hair"], messages()
        assert apart(np.array([p.position for p in strands.data.points]), groomed) == 0.0
        own.live = False
    own.model = MODEL


def _no_strands(rig) -> None:
    """Curves without points, and curves of one point each."""
    scene = bpy.context.scene
    for name, counts in (("Empty", []), ("Dots", [1, 1, 1])):
        bad = bpy.data.objects.new(name, bpy.data.hair_curves.new(name))
        if counts and hasattr(bad.data, "add_curves"):
            bad.data.add_curves(counts)
        scene.collection.objects.link(bad)
        bad.neuralocks_hair.armature, bad.neuralocks_hair.model = rig, MODEL
        bpy.ops.neuralocks.sample_motion()
        bad.neuralocks_hair.live = True
        scene.frame_set(5)
        assert name in messages(), name
        bad.neuralocks_hair.live = False
        bpy.data.objects.remove(bad)


def bad_hair(folder: Path) -> None:
    """Hair and models that cannot be live say why, and deleting or hiding something meanwhile breaks nothing else."""
    rig = scenes.armature()
    skin = scenes.body(rig)
    scenes.dance(rig)
    strands, other = scenes.hair(rig, 20), scenes.hair(rig, 20, name="Other")
    make_live(rig, strands)
    _later_model(strands, folder)
    _not_finite(other)
    shown = _excluded(other, folder)
    _hidden(other, [rig, skin, strands], shown, folder)
    _deleted(rig, skin, strands, other)


def _later_model(strands, folder: Path) -> None:
    """A model of a later version."""
    import zipfile

    later = folder / "later.neuralocks"
    with zipfile.ZipFile(MODEL) as old, zipfile.ZipFile(later, "w") as new:
        for item in old.infolist():
            data = old.read(item)
            new.writestr(item, data.replace(b'"format": 1', b'"format": 99') if item.filename == "model.json" else data)
    points_at(strands, 7)
    strands.neuralocks_hair.model = str(later)
    assert "99" in messages()["Hair"], messages()
    strands.neuralocks_hair.model = MODEL
    assert not messages(), messages()


def _not_finite(hair) -> None:
    """A point that is NaN: the rest of the hair stays where it was."""
    groomed = np.array([p.position for p in hair.data.points])
    first = hair.data.points[0].position.copy()
    hair.data.points[0].position = (float("nan"), 0, 0)
    hair.neuralocks_hair.model = MODEL
    hair.neuralocks_hair.live = True
    assert "finite" in messages()["Other"], messages()
    hair.data.points[0].position = first
    hair.neuralocks_hair.live = False
    assert apart(np.array([p.position for p in hair.data.points]), groomed) == 0.0


def _excluded(hair, folder: Path) -> np.ndarray:
    """Hair in a collection that is excluded while the motion is sampled, and shown afterwards; its points at frame 9."""
    scene = bpy.context.scene
    away = bpy.data.collections.new("Away")
    scene.collection.children.link(away)
    away.objects.link(hair)
    scene.collection.objects.unlink(hair)
    layer = bpy.context.view_layer.layer_collection.children["Away"]
    hair.location, hair.rotation_euler, hair.scale = (0.1, 0.2, 0.0), (0.1, 0.2, 0.4), (1.5, 0.7, -1.0)
    bpy.context.view_layer.update()
    layer.exclude = True
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    scene.frame_set(17)
    layer.exclude = False
    hair.neuralocks_hair.live = True
    shown = points_at(hair, 9)
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    assert apart(points_at(hair, 9), shown) < SAME
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "away.usdc")) == {"FINISHED"}
    assert apart(baked_points(folder / "away.usdc", "/Character/Hair_Other", 9), shown) < SAME
    return shown


def _hidden(hair, others: list, shown: np.ndarray, folder: Path) -> None:
    """Hidden hair is where it is; a hidden armature that nothing visible depends on stands still, which is not its motion."""
    hair.hide_viewport = True
    bpy.context.scene.frame_set(20)
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "hidden.usdc")) == {"FINISHED"}
    assert apart(baked_points(folder / "hidden.usdc", "/Character/Hair_Other", 9), shown) < SAME
    for thing in others:
        thing.hide_viewport = True
    bpy.context.scene.frame_set(14)
    refused(bpy.ops.neuralocks.sample_motion, "hidden")
    for thing in (hair, *others):
        thing.hide_viewport = False


def _deleted(rig, skin, strands, other) -> None:
    """The body is deleted while it is sampled, hair while it is live; what is left is sampled, and then renamed."""
    from dcc_addon.scene.motion.sampling import in_slices
    from dcc_addon.session import session

    steps = in_slices(bpy.context, rig, 0.0)
    next(steps)
    bpy.data.objects.remove(skin)
    for _ in steps:
        pass
    assert session.rigs[rig.name].bodies == ()
    points_at(strands, 3)
    bpy.data.objects.remove(other)
    points_at(strands, 4)
    assert not messages(), messages()
    rig.name, strands.name = "Renamed", "Locks"
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    points_at(strands, 5)
    assert not messages(), messages()


def new_folder(folder: Path) -> None:
    """A bake makes missing folders below one that its user may write to, and no others."""
    rig = scenes.armature()
    strands = scenes.hair(rig, 10)
    bpy.context.scene.neuralocks.armature, strands.neuralocks_hair.model = rig, MODEL
    with patch("os.access", lambda path, mode: Path(path).is_relative_to(folder)):  # as for anyone but root
        assert bpy.ops.neuralocks.bake(filepath=str(folder / "new" / "deeper" / "bake.usdc")) == {"FINISHED"}
        assert (folder / "new" / "deeper" / "bake.usdc").exists()
        elsewhere = str(folder.parent / "other" / "bake.usdc")
        for write in (bpy.ops.neuralocks.bake, bpy.ops.neuralocks.export_skel):
            refused(lambda write=write: write(filepath=elsewhere), "cannot be written")


def no_file(folder: Path) -> None:
    """A header is not written over a folder, nor, without a file name, beside a file that is not saved."""
    rig, export = scenes.armature(bones=scenes.BONES + scenes.TAIL), bpy.ops.neuralocks.export_c
    bpy.context.scene.neuralocks.armature = rig
    refused(export, "//Rig_hair.h", "not saved yet")
    for path in (".", str(folder)):
        refused(lambda path=path: export(filepath=path), "this is a folder")


def into_a_folder(folder: Path) -> None:
    """A bake needs the name of a file, which the disk can hold: nobody would look for it beside a folder, under the folder's name."""
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig)
    strands, operators = scenes.hair(rig, 10), bpy.ops.neuralocks
    bpy.context.scene.neuralocks.armature, bpy.context.scene.neuralocks.hair = rig, strands
    (folder / "there").mkdir()
    for write in (operators.bake, operators.export_skel):
        for path in (f"{folder}/there", f"{folder}/there/", f"{folder}/other/"):
            refused(lambda write=write, path=path: write(filepath=path), path, "folder", "name a file")
        refused(lambda write=write: write(filepath=f"{folder}/{'x' * 300}"), "too long", "choose a shorter one")
    assert [each.name for each in folder.iterdir()] == ["there"] and not any((folder / "there").iterdir())


def not_ours(folder: Path) -> None:
    """Files that an artist made are not overwritten, not even by what is written beside a bake; earlier bakes are."""
    from pxr import Usd

    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig)
    strands, operators = scenes.hair(rig, 10), bpy.ops.neuralocks
    bpy.context.scene.neuralocks.armature, strands.neuralocks_hair.model = rig, MODEL
    assert operators.sample_motion() == {"FINISHED"}
    rig.neuralocks_character.rig_model = str(scenes.rig_model(rig, folder / "rig.neuralocks"))
    writers = [
        (operators.bake, "hair.usdc", "hair_shot.usdc"),
        (operators.export_skel, "rig.usda", "rig_shot.usdc"),
        (operators.export_c, "hair.h", "hair_example.c"),
    ]
    for write, *names in writers:
        first, second = (folder / name for name in names)
        for _ in range(2):
            assert write(filepath=str(first)) == {"FINISHED"}
        for own in (first, second):
            made = own.read_bytes()
            if own.suffix == ".c" or own.suffix == ".h":
                own.write_bytes("Käthe's".encode("latin-1"))
            else:
                stage = Usd.Stage.CreateInMemory()
                stage.DefinePrim("/Mine")
                stage.Export(str(own))
            mine = own.read_bytes()
            refused(lambda write=write, first=first: write(filepath=str(first)), own.name, "Neuralocks did not make it")
            assert own.read_bytes() == mine
            own.write_bytes(made)
