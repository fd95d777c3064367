# SPDX-License-Identifier: GPL-3.0-or-later
"""The live view: the groomed hair is kept, what is rendered is as it is shown, two characters at a time."""

from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import MODEL, SAME, apart, make_live, messages, points_at
from tests.blender.panel import drawn


def sampled_first(_folder: Path) -> None:
    """In a window, the first Live says to wait, without an error: the motion is sampled automatically, unless that failed."""
    from dcc_addon.live import view
    from dcc_addon.session import session

    def said(icon: str) -> bool:
        return any("Rig: its motion" in line for line in drawn(icon))

    rig, strands = scenes.dancer(10)
    scene = bpy.context.scene
    scene.neuralocks.armature, scene.neuralocks.hair = rig, strands
    with patch("dcc_addon.live.unsampled.bpy", SimpleNamespace(app=SimpleNamespace(background=False))):
        strands.neuralocks_hair.live = True
        assert session.sampling.wanting and "sampled as soon as playback stops" in messages()["Hair"], messages()
        assert said("TIME") and not said("ERROR")
        session.sampling.failed.add("Rig")
        view.refresh(scene)
        assert "press Sample Motion" in messages()["Hair"], messages()
        assert said("ERROR") and not said("TIME")


def rest_is_safe(folder: Path) -> None:
    """With Live off, the add-on off, or a file opened without it, the hair is as it was groomed."""
    import dcc_addon

    rig, strands = scenes.dancer(50)
    groomed = np.array([p.position for p in strands.data.points])
    make_live(rig, strands)
    moved = points_at(strands, 14)

    def own():
        return np.array([p.position for p in bpy.data.objects["Hair"].data.points])

    assert apart(own(), groomed) > 1e-3

    file = folder / "live.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    assert apart(scenes.points(strands), moved) < 1e-6, "saving must not disturb the view"
    dcc_addon.unregister()
    assert apart(own(), groomed) == 0.0
    bpy.ops.wm.open_mainfile(filepath=str(file))
    assert apart(own(), groomed) == 0.0
    assert "neuralocks_rest" not in bpy.data.objects["Hair"].data.attributes

    dcc_addon.register()
    strands, rig = bpy.data.objects["Hair"], bpy.data.objects["Rig"]
    assert strands.neuralocks_hair.live
    bpy.context.scene.neuralocks.armature = rig
    bpy.ops.neuralocks.sample_motion()
    assert apart(points_at(strands, 14), moved) < 1e-6
    strands.neuralocks_hair.live = False
    assert apart(own(), groomed) == 0.0
    try:
        keyed = strands.neuralocks_hair.keyframe_insert("bend")
    except TypeError:
        keyed = False
    assert not keyed, "a bake has one look, so the sliders have too"


def saved_from_elsewhere(folder: Path) -> None:
    """Saving while another scene is shown leaves the hair of this one as it was."""
    rig, strands = scenes.dancer(20)
    make_live(rig, strands)
    points_at(strands, 9)

    def own():
        return np.array([p.position for p in strands.data.points])

    moved = own()
    bpy.context.window.scene = bpy.data.scenes.new("Other")
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "two.blend"))
    assert apart(own(), moved) == 0.0 and not messages(), messages()


def rendering(folder: Path) -> None:
    """A final render sees the hair of the viewport, frame by frame, and samples what is out of date."""
    rig, strands = scenes.dancer(30)
    make_live(rig, strands)
    shown = {f: points_at(strands, f) for f in (3, 4, 5)}
    scene = bpy.context.scene
    scene.render.engine, scene.render.resolution_x, scene.render.resolution_y = "CYCLES", 16, 16
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.frame_start, scene.frame_end = 3, 5
    scene.render.filepath = str(folder / "r_")
    places, rendered = {}, {}

    def place(current, graph):
        if graph.mode == "RENDER":
            places[current.frame_current] = np.array(strands.evaluated_get(graph).matrix_world)

    def look(current, *_):
        values, matrix = np.empty((len(strands.data.points), 3), np.float32), places[current.frame_current]
        strands.data.attributes["position"].data.foreach_get("vector", values.ravel())
        rendered[current.frame_current] = values @ matrix[:3, :3].T + matrix[:3, 3]

    bpy.app.handlers.frame_change_post.append(place)
    bpy.app.handlers.render_write.append(look)  # called after all other handlers of a frame
    scene.frame_set(20)
    bpy.ops.render.render(animation=True)
    bpy.app.handlers.frame_change_post.remove(place)
    bpy.app.handlers.render_write.remove(look)
    assert sorted(rendered) == [3, 4, 5]
    for f, points in rendered.items():
        assert apart(points_at(strands, f), points) < SAME
    # The range was shortened before the render, so it had to sample again: the run-up of frames 1 and 2 is gone.
    assert max(apart(rendered[f], shown[f]) for f in shown) > SAME
    rig.pose.bones["head"].rotation_euler[0] += 0.4
    rig.pose.bones["head"].keyframe_insert("rotation_euler", frame=4)
    scene.frame_set(4)
    bpy.ops.render.render()
    after = scenes.points(strands)
    bpy.ops.neuralocks.sample_motion()
    assert apart(points_at(strands, 4), after) < SAME, "the render used a motion that was out of date"


def interface_locked(folder: Path) -> None:
    """A render from a window moves live hair in its own thread, so the interface is locked meanwhile, in any scene of the file: from
    when Live goes on, of strands or of bones, and in files that were saved otherwise; never without Live.
    """
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    strands = scenes.hair(rig, 20)
    bpy.data.scenes.new("Other")

    def unlocked():
        return [scene.name for scene in bpy.data.scenes if not scene.render.use_lock_interface]

    for settings, live in ((strands.neuralocks_hair, "live"), (rig.neuralocks_character, "rig_live")):
        for scene in bpy.data.scenes:
            scene.render.use_lock_interface = False
        setattr(settings, live, False)
        assert len(unlocked()) == 2
        setattr(settings, live, True)
        assert not unlocked()
    for hair, bones in ((True, False), (False, True), (False, False)):
        bpy.data.objects["Hair"].neuralocks_hair.live = hair
        bpy.data.objects["Rig"].neuralocks_character.rig_live = bones
        for scene in bpy.data.scenes:
            scene.render.use_lock_interface = False
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "unlocked.blend"))
        bpy.ops.wm.open_mainfile(filepath=str(folder / "unlocked.blend"))
        assert len(unlocked()) == (0 if hair or bones else 2)


def two_characters(_folder: Path) -> None:
    """Both live, each with its own hair; deleting one leaves the other alive and the hair at rest."""
    first, second = scenes.armature("Anna"), scenes.armature("Ben")
    scenes.dance(first)
    scenes.dance(second)
    for curve in scenes.fcurves(second):
        for key in curve.keyframe_points:
            key.co[1] *= -0.7
    one, two = scenes.hair(first, 20, name="One"), scenes.hair(second, 30, name="Two")
    groomed = np.array([p.position for p in two.data.points])
    make_live(first, one)
    make_live(second, two)
    a, b = points_at(one, 12), points_at(two, 12)
    assert len(a) != len(b)
    bpy.data.objects.remove(second)
    bpy.context.view_layer.update()
    assert apart(points_at(one, 12), a) < 1e-6
    points_at(one, 13)
    assert "Two" in messages() and "armature" in messages()["Two"]
    assert apart(np.array([p.position for p in two.data.points]), groomed) == 0.0


@patch("dcc_addon.background.SLICE", 0.0)
def sampled_in_turn(folder: Path) -> None:
    """When a file with two live characters is opened, each is sampled once, in turn; also if the first one cannot be."""
    from dcc_addon import background
    from dcc_addon.session import session

    file = str(folder / "two.blend")
    for hinder in (None, _headless, _hidden, _excluded):
        scenes.empty()
        for name in ("Anna", "Ben"):
            rig = scenes.armature(name)
            scenes.dance(rig)
            strands = scenes.hair(rig, 10, name=f"Hair of {name}")
            strands.neuralocks_hair.model, strands.neuralocks_hair.live = MODEL, True
        if hinder:
            hinder(bpy.data.objects["Anna"])
        bpy.context.scene.collection.objects.link(bpy.data.objects.new("Beside", None))
        bpy.ops.wm.save_as_mainfile(filepath=file)
        bpy.ops.wm.open_mainfile(filepath=file)
        with patch.object(background, "in_slices", wraps=background.in_slices) as begun:
            for _ in range(100):
                if background.look() is None:
                    break
                if session.sampling.done:  # something else is edited meanwhile
                    bpy.data.objects["Beside"].location.x += 1
                    bpy.context.view_layer.update()
        assert [call.args[1].name for call in begun.call_args_list] == ["Anna", "Ben"], (hinder, begun.call_args_list)
        assert sorted(session.rigs) == (["Ben"] if hinder else ["Anna", "Ben"]) and session.sampling.done is None, (
            hinder
        )
        assert set(messages()) == ({"Anna", "Hair of Anna"} if hinder else set()), messages()
        ben = bpy.data.objects["Hair of Ben"]
        with patch.object(background, "request") as again:
            assert apart(points_at(ben, 9), points_at(ben, 14)) > 1e-3, hinder
            session.rigs["Ben"].stale = session.sampling.wanting = True
            background.look()
        assert not again.called, "neither what has failed, nor a frame that is shown to be sampled, begins a sampling"


def _headless(rig) -> None:
    for bone in rig.data.bones:
        bone.name = f"bone {len(bone.name)}"


def _hidden(rig) -> None:
    for strands in rig.children:
        strands.parent = None
    rig.hide_viewport = True


def _excluded(rig) -> None:
    scene, own = bpy.context.scene, bpy.data.collections.new("Own")
    scene.collection.children.link(own)
    for thing in (rig, *rig.children):
        own.objects.link(thing)
        scene.collection.objects.unlink(thing)
    bpy.context.view_layer.layer_collection.children["Own"].exclude = True


def deformer_added(_folder: Path) -> None:
    """A modifier that would move live hair a second time is off, whenever it is added, and on again afterwards."""
    rig, strands = scenes.dancer(20)
    first = scenes.surface_deform(strands)
    make_live(rig, strands)
    before = points_at(strands, 9)
    second = scenes.surface_deform(strands)
    for _ in range(2):
        assert apart(before, points_at(strands, 9)) == 0.0
        assert not second.show_viewport and not first.show_viewport
        second.show_viewport, first.name = True, "Mine"
    points_at(strands, 10)
    second.name = "Yours"
    second.show_viewport = True
    points_at(strands, 11)
    strands.neuralocks_hair.live = False
    assert all(modifier.show_viewport and modifier.show_render for modifier in strands.modifiers)
