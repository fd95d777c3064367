# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on itself: enabled, disabled, and described in words."""

from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import bpy

from neuralocks_core.errors import NeuralocksError
from tests.blender import scenes
from tests.blender.checks import SAME, apart, make_live, messages, own_handlers, points_at
from tests.blender.panel import drawn, preferences


def lifecycle(folder: Path) -> None:
    """Enable, disable, enable, load another file: nothing is left behind or duplicated."""
    import dcc_addon

    before = len(own_handlers())
    assert before > 5
    dcc_addon.unregister()
    assert not own_handlers()
    assert not [n for n in dir(bpy.types) if n.startswith("NEURALOCKS_")]
    assert not hasattr(bpy.types.Object, "neuralocks_hair")
    assert not _menu_entries()
    dcc_addon.register()
    assert len(_menu_entries()) >= 2
    assert len(own_handlers()) == before
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "empty.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "empty.blend"))
    assert len(own_handlers()) == before
    dcc_addon.unregister()
    assert not own_handlers()
    dcc_addon.register()


def _menu_entries() -> list:
    """What the add-on has put into menus of the 3D viewport."""
    menus = [getattr(bpy.types, name) for name in ("VIEW3D_MT_object", "VIEW3D_MT_pose")]
    drawn = [function for menu in menus for function in getattr(menu.draw, "_draw_funcs", ())]
    return [function for function in drawn if "dcc_addon" in function.__module__]


def panel(folder: Path) -> None:
    """The panel can be drawn at every step of an artist's work, and says what was found and what is wrong."""
    from dcc_addon.session import session

    scene = bpy.context.scene
    assert "Find Character and Hair" in drawn()
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    skin = scenes.body(rig)
    scenes.dance(rig)
    scene.neuralocks.armature = rig
    assert {"Head: head", "Not sampled"} <= set(drawn())
    scene.unit_settings.scale_length = 10.0
    assert bpy.ops.neuralocks.find_chains() == {"FINISHED"}
    assert "m wide" in " ".join(drawn())
    scene.unit_settings.scale_length = 1.0
    strands = scenes.hair(rig, 10)
    strands.neuralocks_hair.armature = None
    scene.neuralocks.hair = strands
    attach = "Attach to Character"  # always in the menu
    assert drawn().count(attach) == 2
    make_live(rig, strands)
    said = drawn()
    assert {"24 frames", f"Body: {skin.name}"} <= set(said), said
    assert said.count(attach) == 1
    assert not any("wide" in line or "range" in line for line in said), said
    scene.frame_set(30)
    assert "Hair only knows the motion of frames 1 to 24" in " ".join(drawn())
    rig.neuralocks_character.loop = True
    strands.neuralocks_hair.model = "/nowhere.neuralocks"
    scene.neuralocks.use_scene_range = False
    assert bpy.ops.neuralocks.find_chains() == {"FINISHED"}
    said = " ".join(drawn())
    assert "differs from" in said and "no such" in said and "2 bones" in said, said
    for well, icon in ((True, "CHECKMARK"), (False, "ERROR")):
        session.said.trained = "Hair: said", well
        assert drawn(icon).count("Hair: said") == 2


def a_part_again(folder: Path) -> None:
    """In a window, the panel tells that hair begins at rest where a part of a shot does that was opened whole, and that a bake's range
    lets it know the whole: then it is as it was.
    """
    from dcc_addon.scene.motion import dependencies

    rig, scene = scenes.armature(), bpy.context.scene
    scenes.dance(rig)
    make_live(rig, scenes.hair(rig, 10))
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    rig, strands, scene = bpy.data.objects["Rig"], bpy.data.objects["Hair"], bpy.context.scene
    rests = "Hair begins at rest at frame 12"
    with patch.object(dependencies, "bpy", SimpleNamespace(app=SimpleNamespace(background=False))):
        make_live(rig, strands)
        whole = points_at(strands, 12)
        assert rests not in " ".join(drawn())
        scene.frame_start, scene.frame_end = 12, 14
        make_live(rig, strands)
        assert rests in " ".join(drawn()) and apart(points_at(strands, 12), whole) > 100 * SAME
        scene.neuralocks.use_scene_range, scene.neuralocks.frame_start, scene.neuralocks.frame_end = False, 1, 24
        make_live(rig, strands)
        assert rests not in " ".join(drawn()) and apart(points_at(strands, 12), whole) < SAME


def model_of_another_body(folder: Path) -> None:
    """The panel tells if live hair's model was trained on a body of other measures, and which measure differs."""
    from neuralocks_core.models import model_file

    shipped, rig = model_file.read(model_file.shipped("strands")), scenes.armature()
    scenes.body(rig)
    scenes.dance(rig)
    strands = scenes.hair(rig, 10)
    for measures, told in ((None, False), ({"lowest": [0.5] * 10, "highest": [0.6] * 10}, True)):
        card = {**shipped.meta["training"], "measures": measures}
        name = folder / f"{told}.neuralocks"
        model_file.write(name, {**shipped.meta, "training": card}, shipped.graphs)
        make_live(rig, strands, model=str(name))
        said = " ".join(drawn())
        assert ("was trained on another body: " in said and "(trained: 0.5 to 0.6)" in said) == told, said


def hair_beside_its_character(_folder: Path) -> None:
    """Hair that lies far from the skin swings there: the panel says so at once, and not only a bake."""
    rig, strands = scenes.dancer(10, skinned=True)
    for x, told in ((0.0, False), (2.0, True), (0.1, False)):
        strands.neuralocks_hair.live = False
        strands.location.x = x
        bpy.context.view_layer.update()
        make_live(rig, strands)
        said = " ".join(drawn())
        assert ("m from the skin; put its object where the head is" in said) == told, (x, said)


def told_of_what_is_there(_folder: Path) -> None:
    """Messages go with their object: after it is renamed or deleted, another object that gets its name has none of its messages,
    and the same hair is listed under its new name.
    """
    from dcc_addon.session import session

    rig, strands = scenes.dancer(10)
    scene = bpy.context.scene
    make_live(rig, strands)
    bpy.ops.neuralocks.report_card()
    strands.neuralocks_hair.model = "/nowhere.neuralocks"
    assert "Hair" in messages() and "Hair" in session.said.cards
    strands.name = "Locks"
    bpy.context.view_layer.update()
    assert set(messages()) == {"Locks"} and not session.said.cards, messages()
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    assert "nowhere" in messages()["Locks"]
    scene.neuralocks.hair = scenes.hair(rig, 10)
    assert scene.neuralocks.hair.name == "Hair"
    assert "no such" not in " ".join(drawn())
    bpy.data.objects.remove(strands)
    bpy.context.view_layer.update()
    assert not messages(), messages()

    session.said.tell("Rig", NeuralocksError("Rig: a bone of it is gone"))  # as sampling in the background does
    rig.name = "Anna"
    bpy.context.view_layer.update()
    assert not messages(), messages()


def words(_folder: Path) -> None:
    """Every operator is found by Blender's search, and everything has a name and a tooltip."""
    import dcc_addon
    from dcc_addon import operators
    from dcc_addon.interface import properties
    from dcc_addon.interface.preferences import Preferences

    assert dcc_addon.bl_info["name"] == "Neuralocks"
    for cls in operators.CLASSES:
        operator = getattr(bpy.ops.neuralocks, cls.bl_idname.split(".")[1])
        described = operator.get_rna_type()
        assert described.name == cls.bl_label and "INTERNAL" not in getattr(cls, "bl_options", ())
        assert described.description and not described.description.endswith("."), cls.bl_idname
        assert operator.poll(), "search hides what cannot run, and then nobody hears why"
        for prop in described.properties:
            assert prop.identifier == "rna_type" or prop.description, (cls.bl_idname, prop.identifier)
            names = prop.type in ("STRING", "ENUM")  # what a run is about, and the next one is not
            assert prop.is_skip_save or not names, (cls.bl_idname, prop.identifier)
    for cls in (*properties.CLASSES, Preferences):
        for prop in cls.bl_rna.properties:
            if prop.identifier in cls.__annotations__:
                assert prop.name and prop.description and not prop.description.endswith("."), prop.identifier
                capital = prop.name if prop.is_hidden else prop.name.title()
                assert all(a == b for a, b in zip(prop.name.split(), capital.split()) if len(a) > 3), prop.name
                assert "--" not in prop.description, prop.identifier
                if prop.type == "ENUM":
                    assert all(item.description for item in prop.enum_items), prop.identifier


def remedy_in_full(_folder: Path) -> None:
    """The preferences break what training lacks into lines: one label would be cut off before the command to run."""
    said = " ".join(["Training needs a Python with torch"] * 6)
    with patch("dcc_addon.interface.preferences.known_problem", return_value=said):
        *lines, button = preferences()
    assert " ".join(lines) == said and max(map(len, lines)) <= 40, lines
    assert button == "Copy Install Command"


def command_is_copied(_folder: Path) -> None:
    """Typed from the panel, where it is wrapped into lines, it would come out wrong."""
    from dcc_addon.operators.training import NEURALOCKS_OT_copy_install
    from dcc_addon.services.training.training_job import installing

    context = MagicMock()
    message = NEURALOCKS_OT_copy_install.work(SimpleNamespace(), context)
    assert context.window_manager.clipboard == installing() and "terminal" in message
    assert bpy.ops.neuralocks.copy_install() == {"FINISHED"}
