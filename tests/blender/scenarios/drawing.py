# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels in the states of an artist's work, drawn by Blender itself."""

from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import bpy

from tests.blender import panel, scenes
from tests.blender.checks import MODEL, choose, give_bone_model, make_live
from tests.blender.panel import drawn


def drawing_is_strict(_folder: Path) -> None:
    """What Blender does not know, or forbids while it draws, does not pass for drawn."""
    scene = bpy.context.scene
    assert panel.shown(lambda layout: layout.row().label(text="Right", icon="TIME"), "TIME") == ["Right"]
    for wrong, said in (
        (lambda layout: layout.prop(scene.neuralocks, "nothing"), "nothing"),
        (lambda layout: layout.prop_search(scene.neuralocks, "output", bpy.data, "nothing"), "nothing"),
        (lambda layout: layout.label(text="", icon="NOTHING"), "NOTHING"),
        (lambda layout: layout.label(nothing=""), "nothing"),
        (lambda layout: setattr(layout, "nothing", 1), "nothing"),
        (lambda layout: layout.operator("neuralocks.nothing"), "nothing"),
        (lambda layout: setattr(layout.operator("neuralocks.train"), "kind", "nothing"), "nothing"),
        (lambda layout: layout.menu("NEURALOCKS_MT_nothing"), "nothing"),
        (lambda _layout: setattr(scene, "frame_start", 2), "not allowed"),
        (lambda _layout: bpy.ops.neuralocks.find(), "drawing"),
    ):
        try:
            panel.shown(wrong)
        except AssertionError as error:
            assert said in str(error), error
        else:
            raise AssertionError(f"drawn: {said}")


def drawn_at_choices(_folder: Path) -> None:
    """What is chosen: a rig without a head, hair of another character, in several modes, gone from the scene, or no hair."""
    scene = bpy.context.scene
    scene.neuralocks.armature = scenes.armature(
        "Snake", (("a", "", (0, 0, 0), (0, 0, 1)), ("b", "a", (0, 0, 1), (0, 0, 2)))
    )
    assert any("head" in line for line in drawn("ERROR"))
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    skin = scenes.body(rig)
    strands = scenes.hair(rig, 10)
    scene.neuralocks.hair = strands
    assert {"This hair belongs to Rig", "Attach to Character"} <= set(drawn())
    scene.neuralocks.armature, rig.neuralocks_character.body = rig, skin
    assert "Head: head" in drawn("INFO")
    for thing, modes in (
        (rig, ("EDIT", "POSE")),
        (skin, ("EDIT", "WEIGHT_PAINT")),
        (strands, ("EDIT", "SCULPT_CURVES")),
    ):
        choose(thing)
        for mode in modes if thing != strands or bpy.app.version >= (3, 5) else ():
            bpy.ops.object.mode_set(mode=mode)
            assert drawn()
            bpy.ops.object.mode_set(mode="OBJECT")
    choose(skin)
    bpy.ops.object.particle_system_add()
    skin.particle_systems[0].settings.type = "HAIR"
    assert drawn().count("Convert Particle Hair") == 2  # in the menu always
    if bpy.app.version >= (3, 5):  # older ones do not convert it
        choose(strands)
        bpy.ops.object.convert(target="MESH")
        assert strands.type == "MESH" and "no longer a hair Curves object" in " ".join(drawn())
    for thing in (strands, skin, rig):
        scene.collection.objects.unlink(thing)
        assert drawn()
    for thing in (strands, skin, rig):
        bpy.data.objects.remove(thing)
        assert drawn()
    assert scene.neuralocks.armature is None and "Find Character and Hair" in drawn()


def drawn_at_work(folder: Path) -> None:
    """What is made: hair live and out of date, being prepared, with a damaged model; a report card, bones with keys, a cache."""
    from dcc_addon.session import session

    rig, scene = scenes.armature(bones=scenes.BONES + scenes.TAIL), bpy.context.scene
    scenes.dance(rig)
    scenes.body(rig)
    strands = scenes.hair(rig, 10)
    make_live(rig, strands)
    assert "24 frames" in drawn("CHECKMARK")
    session.rigs["Rig"].stale = True
    assert "Out of date" in drawn("ERROR")
    session.sampling.done = 0.3
    assert "Sampling 30 %" in drawn("TIME")
    session.sampling.done = None
    session.preparing["Hair"] = SimpleNamespace(done=0.25, cancel=lambda: None), None
    assert "Preparing 25 %, Live cancels" in drawn()
    session.stop_preparing_all()
    (folder / "torn.neuralocks").write_bytes(Path(MODEL).read_bytes()[:5000])
    strands.neuralocks_hair.model = str(folder / "torn.neuralocks")
    assert "torn.neuralocks" in "".join(drawn())
    strands.neuralocks_hair.model = MODEL
    scenes.surface_deform(strands)
    strands.neuralocks_hair.live = False
    strands.neuralocks_hair.live = True
    assert any("Off while Live" in line for line in drawn("INFO"))
    assert bpy.ops.neuralocks.report_card() == {"FINISHED"}
    assert " ".join(session.said.cards["Hair"]) in " ".join(drawn()).replace("\u00a0", " "), session.said.cards
    give_bone_model(rig, folder)
    assert bpy.ops.neuralocks.find_chains() == {"FINISHED"}
    rig.neuralocks_character.rig_live = True
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    assert "2 bones" in " ".join(drawn())
    scene.neuralocks.output = "//hair.usdc"
    assert any("Save this file first" in line for line in drawn("INFO"))
    if getattr(bpy.app.build_options, "usd", False):
        scene.neuralocks.output = str(folder / "hair.usdc")
        assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"}
        assert "24 frames" in drawn("CHECKMARK")


def drawn_at_training(_folder: Path) -> None:
    """A training that runs, has failed or is done, one that lacks torch, and a Python that has not answered yet."""
    from dcc_addon.operators import training
    from dcc_addon.session import session

    rig = scenes.armature()
    strands = scenes.hair(rig, 10)
    bpy.context.scene.neuralocks.armature, bpy.context.scene.neuralocks.hair = rig, strands
    for answer, said in (
        (None, "Checking what training needs"),
        ("Training needs torch", "needs torch"),
        ("", "Ready to train"),
    ):
        with patch.object(training._trainers, "known", return_value=answer):
            assert said in " ".join(panel.preferences())
            assert (
                ("Copy Install Command" in panel.preferences())
                == (drawn().count("Copy Install Command") == 3)
                == bool(answer)
            )
    assert drawn().count("Train for This Character") == 3 and "Train Hair Bones for This Character" in drawn()
    for done, left in ((0.0, None), (0.4, 200.0), (1.0, 0.0)):
        job = SimpleNamespace(
            done=done, seconds_left=left, message="Motion error 0.25, learned", lines=0, notes=["Rig: has no neck"]
        )
        with patch.object(training, "_running", [training._Training(job, None, None, {})]):
            said = drawn()
        assert {"Motion error 0.25, learned", "Rig: has no neck"} < set(said), said
        assert any(f"Training {100 * done:.0f} %" in line for line in said), said
    for well, icon in ((True, "CHECKMARK"), (False, "ERROR")):
        session.said.trained = "Hair: it ended", well
        assert drawn(icon).count("Hair: it ended") == 2
