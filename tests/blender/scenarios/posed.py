# SPDX-License-Identifier: GPL-3.0-or-later
"""Live hair follows what is posed and moved by hand, and what is edited is noticed: its motion is sampled again."""

import time
from pathlib import Path

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import SAME, apart, baked_points, make_live, messages, points_at


def posing(folder: Path) -> None:
    """The hair follows a pose made by hand without a frame change; edited animation is noticed and sampled again."""
    from dcc_addon.session import session

    rig = scenes.armature()
    skin = scenes.body(rig)
    scenes.dance(rig)
    strands = scenes.hair(rig, 50)
    make_live(rig, strands)
    before = points_at(strands, 9)
    rig.pose.bones["head"].rotation_euler[1] += 0.5
    bpy.context.view_layer.update()
    bpy.context.view_layer.update()
    posed = scenes.points(strands)
    assert apart(posed, before) > 0.02
    assert apart(points_at(strands, 9), before) < 1e-6, (
        "the pose was not keyed, so the frame brings the animated one back"
    )
    assert not session.rigs["Rig"].stale

    for vertex in skin.data.vertices:
        vertex.co.x *= 1.01
    skin.data.update()
    bpy.context.view_layer.update()
    assert session.rigs["Rig"].stale, "the body that hair is kept out of is another one"
    bpy.ops.neuralocks.sample_motion()
    before = points_at(strands, 9)
    assert not session.rigs["Rig"].stale
    rig.pose.bones["head"].rotation_euler[1] += 0.5
    rig.pose.bones["head"].keyframe_insert("rotation_euler", frame=9)
    points_at(strands, 8)
    assert session.rigs["Rig"].stale
    rig.pose.bones["spine"].rotation_euler[0] += 0.3  # not keyed yet
    rig.location.x += 0.1
    rig["switch"] = 1.0
    rig.keyframe_insert('["switch"]', frame=8)
    rig["switch"] = 0.0
    bpy.context.view_layer.update()
    bpy.context.view_layer.update()
    unkeyed, turn, place = scenes.points(strands), rig.pose.bones["spine"].rotation_euler[0], rig.location.x
    bpy.ops.neuralocks.sample_motion()
    assert (rig.pose.bones["spine"].rotation_euler[0], rig.location.x, rig["switch"]) == (turn, place, 0.0)
    assert apart(scenes.points(strands), unkeyed) < 0.02, "sampling took a pose away that was not keyed"
    assert not session.rigs["Rig"].stale
    after = points_at(strands, 9)
    assert apart(after, before) > 0.02
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "b.usdc")) == {"FINISHED"}
    assert apart(baked_points(folder / "b.usdc", "/Character/Hair_Hair", 9), after) < SAME


def skin_posed(folder: Path) -> None:
    """Hair is kept out of skin posed by hand, whatever bone it is attached to, at once, and in all frames once Blender was idle;
    but live hair bones do not move other hair.
    """
    from dcc_addon import background
    from dcc_addon.session import session

    pad = ("pad.L", "chest", (0.05, 0.02, 1.45), (0.05, 0.25, 1.5))
    rig = scenes.armature(bones=[*scenes.BONES, *scenes.TAIL, pad])
    scenes.body(rig)
    scenes.dance(rig)
    strands, own = scenes.hair(rig, 60, length=0.4), rig.neuralocks_character
    make_live(rig, strands, resolve=True)
    before = points_at(strands, 9)
    own.rig_model = str(scenes.rig_model(rig, folder / "rig.neuralocks"))
    own.rig_live = True
    assert apart(points_at(strands, 8), points_at(strands, 9)) > 1e-3 and apart(scenes.points(strands), before) == 0.0
    assert rig.pose.bones["hair.01"].rotation_mode == "QUATERNION" and not session.rigs["Rig"].stale

    rig.pose.bones["pad.L"].rotation_euler = (0.9, 0.3, 0)
    bpy.context.view_layer.update()
    posed = scenes.points(strands)
    assert apart(posed, before) > 0.01
    strands.neuralocks_hair.resolve = False
    free = scenes.points(strands)
    strands.neuralocks_hair.resolve = True
    assert apart(free, posed) > 0.01
    known = [session.rigs["Rig"]]
    for _ in range(2):
        background.doubt()
        while background.look() is not None:
            pass
        known.append(session.rigs["Rig"])
    assert known[0] is not known[1] and known[1] is known[2] and not known[2].stale
    shown = points_at(strands, 9)
    assert apart(shown, posed) < SAME
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "posed.usdc")) == {"FINISHED"}
    assert apart(baked_points(folder / "posed.usdc", "/Character/Hair_Hair", 9), shown) < SAME
    assert not messages(), messages()


def not_keyed(_folder: Path) -> None:
    """An animated value that was changed and is not keyed yet stays when the motion is sampled, whatever kind of value it is."""
    rig, lists = scenes.armature(), bpy.data
    skin, strands = scenes.body(rig), scenes.hair(rig, 5)
    bpy.context.scene.neuralocks.armature = rig
    owners = [rig, rig.data, skin.data, strands.data, lists.textures.new("T", "CLOUDS")]
    kinds = ("cameras", "lattices", "linestyles", "masks", "materials", "metaballs", "particles", "speakers", "volumes")
    owners += [getattr(lists, kind).new("Own") for kind in kinds]
    for owner in owners:
        owner["value"] = 1.0
        assert owner.keyframe_insert('["value"]', frame=1)
        owner["value"] = 2.0
    camera, warp = lists.cameras["Own"], skin.modifiers.new("Warp", "UV_WARP")
    called_so = [(camera.background_images.new(), "scale"), (warp, "scale"), (rig.pose.bones["head"], "scale")]
    for owner, name in called_so:
        assert owner.keyframe_insert(name, frame=1)
        setattr(owner, name, 3.0 if owner not in (warp, rig.pose.bones["head"]) else (3.0,) * len(getattr(owner, name)))
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    assert all(np.all(np.array(getattr(owner, name)) == 3.0) for owner, name in called_so)
    assert not (lost := [owner for owner in owners if owner["value"] != 2.0]), lost


def seen_by_another_camera(_folder: Path) -> None:
    """Sampling steps through frames at which markers change the camera; afterwards it is the one that the artist chose."""
    rig, scene = scenes.armature(), bpy.context.scene
    scenes.dance(rig)
    scenes.hair(rig, 4)
    cameras = [bpy.data.objects.new(name, bpy.data.cameras.new(name)) for name in "ABC"]
    for camera, frame in zip(cameras, (1, 12, 0), strict=True):
        scene.collection.objects.link(camera)
        if frame:
            scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    scene.frame_set(5)
    scene.neuralocks.armature = rig
    for chosen in (cameras[2], cameras[0], None):
        scene.camera = chosen
        assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
        assert scene.camera == chosen and scene.frame_current == 5


def between_frames(_folder: Path) -> None:
    """Sampling ends at the frame and fraction that were shown, also before frame 0, where Blender's fractions are negative."""
    rig, strands = scenes.dancer(5)
    scene = bpy.context.scene
    make_live(rig, strands)
    for frame, fraction in ((-3, 0.25), (9, 0.3)):
        before, shown = points_at(strands, frame, fraction), (scene.frame_current, scene.frame_subframe)
        assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
        assert (scene.frame_current, scene.frame_subframe) == shown
        assert apart(scenes.points(strands), before) < 1e-6


def many_animated(_folder: Path) -> None:
    """In a scene of thousands of animated objects, putting unkeyed values back takes little longer than reading them, since objects
    are not looked up one by one: both are done before and after each slice of sampling.
    """
    from dcc_addon.scene.motion.unkeyed_poses import Unkeyed

    action, scene = bpy.data.actions.new("Crowd"), bpy.context.scene
    for number in range(3000):
        thing = bpy.data.objects.new(f"Extra {number:04d}", None)
        scene.collection.objects.link(thing)
        thing.animation_data_create().action = action
    began = time.thread_time()
    unkeyed = Unkeyed(scene)
    read = time.thread_time() - began
    thing.location.x = 1.0
    began = time.thread_time()
    unkeyed.put_back()
    assert thing.location.x == 0.0
    assert time.thread_time() - began < 3 * read


def moved_hair(folder: Path) -> None:
    """A hair object that is moved makes the sampling stale, and the bake agrees again; stretched time changes nothing;
    objects that share their curves are refused, and neither is moved.
    """
    from dcc_addon.scene.motion.dependencies import key_of
    from dcc_addon.session import session

    rig = scenes.armature()
    scenes.dance(rig)
    strands, scene = scenes.hair(rig, 30), bpy.context.scene
    make_live(rig, strands)
    points_at(strands, 9)
    strands.location.x += 0.1
    assert not session.rigs["Rig"].stale
    points_at(strands, 10)
    assert session.rigs["Rig"].stale
    scene.render.frame_map_old, scene.render.frame_map_new = 100, 200
    assert session.rigs["Rig"].key != key_of(rig, scene)
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    shown = {f: points_at(strands, f) for f in (4, 19)}
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "moved.usdc")) == {"FINISHED"}
    for f, points in shown.items():
        assert apart(baked_points(folder / "moved.usdc", "/Character/Hair_Hair", f), points) < SAME

    twin = bpy.data.objects.new("Twin", strands.data)
    scene.collection.objects.link(twin)
    points_at(strands, 5)
    assert "share" in messages()["Hair"], messages()
    assert "neuralocks_rest" not in strands.data.attributes
    twin.data = twin.data.copy()
    points_at(strands, 5)
    assert not messages(), messages()


def far_from_the_origin(_folder: Path) -> None:
    """Single precision, in which poses are stored, is coarse 20 m away in a scene of centimetres: what nobody edited is still up to
    date, and an edit is noticed.
    """
    from dcc_addon.scene.motion.up_to_date import ensure
    from dcc_addon.session import session

    rig, scene = scenes.armature(), bpy.context.scene
    scenes.dance(rig)
    place = bpy.data.objects.new("Place", None)
    scene.collection.objects.link(place)
    place.location, rig.parent = (3000, 2100, 0), place
    strands = scenes.hair(rig, 10)
    make_live(rig, strands)
    sampled = session.rigs["Rig"]
    for frame in range(1, 25):
        scene.frame_set(frame)
        assert not sampled.stale, frame
    assert ensure(bpy.context, rig) is sampled, "no frame is as it was"
    place.location.x += 0.01
    scene.frame_set(9)
    assert sampled.stale
