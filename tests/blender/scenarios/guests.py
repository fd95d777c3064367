# SPDX-License-Identifier: GPL-3.0-or-later
"""Characters that another scene draws, as its set or in an instance of their collection."""

import time
from pathlib import Path
from unittest.mock import patch

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import apart, make_live, messages, points_at
from tests.blender.witness import ENGINE, film, witness


def drawn_by_another_scene(folder: Path) -> None:
    """Scrubbed and rendered in the scene that draws it, also in a file just opened, live hair is what its own scene shows at that
    frame, whichever is in view; also within the shutter, and with live hair bones.
    """
    from dcc_addon.scene.character.layers import graph_of

    scene, wanted = _own(folder), {}
    for frame in (5, 9):
        wanted[frame] = _seen(bpy.data.objects["Hair"], _shown(scene, frame))
    scene.frame_set(3)
    for way, show in (("instance", _instance), ("set", _set), ("nested", _nested)):
        other = bpy.data.scenes.new(way)
        show(other, scene)
        film(other)
        other.frame_start, other.frame_end = 5, 9
        other.frame_step, other.render.filepath = 4, str(folder / "r_")
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    got = {}

    def look(_engine, graph):
        got[graph.scene.frame_current] = _seen(bpy.data.objects["Hair"], graph)

    def same(now, frame):
        return all(apart(a, b) < 1e-6 for a, b in zip(now, wanted[frame], strict=True))

    with witness(look):
        for way in ("instance", "set", "nested"):
            for in_view in (way, "Scene"):
                bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
                other = bpy.data.scenes[way]
                bpy.context.window.scene, other.render.engine = bpy.data.scenes[in_view], ENGINE
                got.clear()
                bpy.ops.render.render(animation=True, scene=way)
                assert sorted(got) == [5, 9] and not messages(), (way, got, messages())
                assert all(same(got[frame], frame) for frame in got), (way, in_view)
                other.frame_current = 5
                bpy.ops.render.render(scene=way)
                assert same(got[5], 5) and bpy.data.scenes["Scene"].frame_current == 3, (way, in_view)
                assert not bpy.data.objects["Hair"].modifiers
            bpy.context.window.scene = other
            for frame in (9, 5):
                other.frame_set(frame)
                assert same(_seen(bpy.data.objects["Hair"], graph_of(other, other.view_layers[0])), frame), way


@patch("dcc_addon.live.live_strands.at_once", lambda graph: False)
def shown_before_its_own_scene(folder: Path) -> None:
    """If a file opens in the scene that draws the hair, the hair is sampled in a scene that Blender has never shown, prepared in
    the background, and then is as in its own scene; also at the first frame, if the file was saved at another.
    """
    from dcc_addon import background
    from dcc_addon.live import preparing
    from dcc_addon.scene.character.layers import graph_of
    from dcc_addon.session import session

    scene = _own(None)
    other = bpy.data.scenes.new("Shot")
    _set(other, scene)
    wanted = _seen(bpy.data.objects["Hair"], _shown(scene, 9))
    poses = session.rigs["Rig"].motion.rotation
    bpy.context.window.scene = other
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    other, scene = bpy.data.scenes["Shot"], bpy.data.scenes["Scene"]
    assert bpy.context.scene == other and scene.view_layers[0].depsgraph is None
    other.frame_set(9)
    while background.look() is not None or preparing.look() is not None:
        time.sleep(0.01)
    assert np.array_equal(session.rigs["Rig"].motion.rotation, poses) and not messages(), messages()
    got = _seen(bpy.data.objects["Hair"], graph_of(other, other.view_layers[0]))
    assert all(apart(a, b) < 1e-6 for a, b in zip(got, wanted, strict=True))


def not_drawn_by_another_scene(_folder: Path) -> None:
    """A scene that does not show a character leaves its hair alone, and so does one that has it in an excluded collection."""
    from dcc_addon.scene.drawing.other_scenes import guests
    from dcc_addon.scene.hair import curves

    scene = _own(None)
    strands = bpy.data.objects["Hair"]
    shown = points_at(strands, 9)
    other = bpy.data.scenes.new("Other")
    bpy.context.window.scene = other
    other.frame_set(5)
    assert not guests(other)
    _instance(other, scene)
    other.collection.children.link(bpy.data.collections.new("Off"))
    empty = other.collection.objects[0]
    bpy.data.collections["Off"].objects.link(empty)
    other.collection.objects.unlink(empty)
    other.view_layers[0].layer_collection.children["Off"].exclude = True
    assert {thing.name for thing, _ in guests(other)} == {"Hair"}
    written = curves.shown(strands.data).copy()
    other.frame_set(6)
    assert apart(curves.shown(strands.data), written) == 0 and not messages(), messages()
    bpy.context.window.scene = scene
    assert apart(points_at(strands, 9), shown) < 1e-6


def named_as_another(folder: Path) -> None:
    """A set from a library moves beside objects of the same names; and no scene's objects are scanned twice per frame, because
    there may be ten thousand.
    """
    from dcc_addon.live import view
    from dcc_addon.scene.drawing import other_scenes
    from dcc_addon.scene.objects import live_objects

    _own(None)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "set.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(str(folder / "set.blend"), link=True) as (_, linked):
        linked.scenes = ["Scene"]
    scene, behind = bpy.context.scene, linked.scenes[0]
    assert behind.library
    for name in ("Hair", "Rig"):
        scene.collection.objects.link(bpy.data.objects.new(name, None))
    for drawn, passes in ((None, 1), (behind, 2)):
        scene.background_set = drawn
        graph = bpy.context.evaluated_depsgraph_get()
        with (
            patch.object(view, "lively", wraps=live_objects.lively) as looks,
            patch.object(other_scenes, "lively", looks),
        ):
            view.update(scene, graph)
            assert looks.call_count == passes
    assert [(thing.name, home) for thing, home in other_scenes.guests(scene)] == [("Hair", behind)]


def _own(folder):
    """A scene with a character in its own collection, with live hair, and if a folder is given, hair bones too."""
    rig, scene = scenes.armature(bones=scenes.BONES + scenes.TAIL), bpy.context.scene
    scenes.body(rig)
    scenes.dance(rig)
    strands = scenes.hair(rig, 20)
    scenes.collect("Character")
    make_live(rig, strands)
    if folder is not None:
        rig.neuralocks_character.rig_model = str(scenes.rig_model(rig, folder / "rig.neuralocks"))
        rig.neuralocks_character.rig_live = True
    return scene


def _shown(scene, frame):
    scene.frame_set(frame)
    return bpy.context.evaluated_depsgraph_get()


def _seen(strands, graph) -> tuple:
    """Points of the hair and matrices of the bones as a depsgraph has them."""
    rig = strands.neuralocks_hair.armature.evaluated_get(graph)
    return scenes.points(strands, graph), np.array([np.array(bone.matrix) for bone in rig.pose.bones])


def _instance(other, _scene) -> None:
    empty = bpy.data.objects.new("Instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", bpy.data.collections["Character"]
    other.collection.objects.link(empty)


def _set(other, scene) -> None:
    other.background_set = scene


def _nested(other, scene) -> None:
    """An instance of a collection in which there is an instance."""
    crowd = bpy.data.collections.new("Crowd")
    empty = bpy.data.objects.new("Within", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", bpy.data.collections["Character"]
    crowd.objects.link(empty)
    outer = bpy.data.objects.new("Outer", None)
    outer.instance_type, outer.instance_collection = "COLLECTION", crowd
    other.collection.objects.link(outer)
