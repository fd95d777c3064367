# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of what moves a rig in other frames than the one that is shown, of which Blender tells nothing."""

import io
import math
from contextlib import redirect_stdout
from pathlib import Path
from unittest.mock import patch

import bpy

from tests.blender import panel, scenes
from tests.blender.checks import apart, make_live, messages, points_at
from tests.blender.witness import ENGINE, film, witness

FRAMES = (2, 12, 20)


def rendered_as_edited(_folder: Path) -> None:
    """A render starts from the current motion: after a path's shape, a bone's rotation mode or a rest bone was changed, and after
    edits that are on no list but show in some frames of the range.
    """
    from dcc_addon import handlers
    from dcc_addon.session import session

    cases = [(_path, edit) for edit in (_handle, _tilt, _cyclic, _twisted)]
    cases += [(_nothing, edit) for edit in (_turned_in_another_mode, _at_rest)]
    cases += [(_object_turned, _turned_in_another_mode_as_a_whole), (_ground, _raised)]
    cases += [(_long_ground, edit) for edit in (_sculpted, _displaced)] + [(_keyed_ground, _shaped), (_saddle, _still)]
    for setup, edit in cases:
        scenes.empty()
        rig, scene = scenes.armature(), bpy.context.scene
        scenes.dance(rig)
        strands, moved_by = scenes.hair(rig, 10), setup(rig)
        make_live(rig, strands, resolve=False)
        before = {frame: points_at(strands, frame) for frame in FRAMES}
        scene.frame_set(1)
        sampled = session.rigs["Rig"]
        handlers.before_render(scene)
        handlers.after_render()
        assert session.rigs["Rig"] is sampled, f"nothing was edited before {edit.__name__}"
        edit(rig, moved_by)
        bpy.context.view_layer.update()
        handlers.before_render(scene)
        handlers.after_render()
        assert scene.frame_current == 1
        drawn = {frame: points_at(strands, frame) for frame in FRAMES}
        scene.frame_set(1)
        assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
        after = {frame: points_at(strands, frame) for frame in FRAMES}
        assert max(apart(after[frame], before[frame]) for frame in FRAMES) > 1e-3, edit.__name__
        assert max(apart(after[frame], drawn[frame]) for frame in FRAMES) < 1e-6, edit.__name__
        assert not messages(), messages()


def ground_sculpted(_folder: Path) -> None:
    """What the character stands on is sculpted where it is not now: while Blender is idle, its motion is sampled again; another
    object's shape does not matter.
    """
    from dcc_addon import background
    from dcc_addon.session import session

    rig = scenes.armature()
    scenes.dance(rig)
    strands, mesh = scenes.hair(rig, 10), _long_ground(rig)
    bpy.ops.mesh.primitive_cube_add()
    beside = bpy.context.object.data
    make_live(rig, strands, resolve=False)
    bpy.context.view_layer.update()
    for edited, again in ((beside, False), (mesh, True)):
        while background.look() is not None:
            pass
        sampled = session.rigs["Rig"]
        _sculpted(rig, edited)
        bpy.context.view_layer.update()
        while background.look() is not None:
            pass
        assert (session.rigs["Rig"] is not sampled) == again, edited.name
    assert not session.rigs["Rig"].stale


def misrendered(folder: Path) -> None:
    """A render that shows other frames than were sampled, of which nothing told before, says so in the panel and once on the console,
    until the next one, which is right.
    """
    from dcc_addon.session import session

    rig, scene = scenes.armature(), bpy.context.scene
    scenes.dance(rig)
    strands, got, texture = scenes.hair(rig, 10), {}, bpy.data.textures.new("Bump", "CLOUDS")
    _long_ground(rig)
    bump = bpy.data.objects["Ground"].modifiers["Bump"]
    bump.texture, bump.strength, texture.intensity = texture, 0.4, 0.0
    scene.frame_set(1)
    make_live(rig, strands, resolve=False)
    film(scene)
    scene.neuralocks.frame_start, scene.neuralocks.frame_end, scene.neuralocks.use_scene_range = 1, 24, False
    scene.frame_start, scene.frame_end, scene.render.filepath = 12, 20, str(folder / "r_")

    def look(_engine, graph):
        got[graph.scene.frame_current] = scenes.points(strands, graph)

    texture.intensity = 1.0  # on no list
    told = "hair may be wrong in the last render, from frame 15 on"
    with witness(look):
        scene.render.engine = ENGINE
        for wrong in (True, False):
            with redirect_stdout(io.StringIO()) as said:
                bpy.ops.render.render(animation=True)
            assert said.getvalue().count(told) == wrong and (told in " ".join(panel.drawn())) == wrong
            rendered = dict(got)
            if wrong:
                assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"} and told in session.said.misrendered["Rig"]
            off = max(apart(points, points_at(strands, frame)) for frame, points in rendered.items())
            assert off > 1e-3 if wrong else off < 1e-6, off
    assert not messages(), messages()


def many_drivers(_folder: Path) -> None:
    """However many drivers read a rig, what animates it is listed as often as for one: in a control rig with hundreds of them, each
    look at the unkeyed values would otherwise block Blender for seconds.
    """
    from dcc_addon.scene.motion.dependencies import posture_of
    from dcc_addon.scene.objects.animated import animated

    rig, scene = scenes.armature(), bpy.context.scene
    rig["switch"] = 0.5
    bones, listed = list(rig.pose.bones), []
    for count in (1, len(bones)):
        for bone in bones[:count]:
            bone.driver_remove("location")
            for curve in bone.driver_add("location"):
                read = curve.driver.variables.new().targets[0]
                read.id, read.data_path = rig, '["switch"]'
        with patch("dcc_addon.scene.motion.rigging.animated", wraps=animated) as listing:
            seen = posture_of(rig, scene)
        listed.append(listing.call_count)
    assert listed[0] == listed[1]
    rig["switch"] = 0.25
    assert posture_of(rig, scene) != seen


def _nothing(_rig) -> None:
    return None


def _path(rig):
    """A path that the rig follows."""
    data = bpy.data.curves.new("Path", "CURVE")
    data.dimensions = "3D"
    spline = data.splines.new("BEZIER")
    spline.bezier_points.add(2)
    for number, point in enumerate(spline.bezier_points):
        point.co = (number, math.sin(number), 0)
        point.handle_left_type = point.handle_right_type = "AUTO"
    path = bpy.data.objects.new("Path", data)
    bpy.context.scene.collection.objects.link(path)
    follow = rig.constraints.new("FOLLOW_PATH")
    follow.target, follow.use_fixed_location, follow.use_curve_follow = path, True, True
    for frame, share in ((1, 0), (24, 0.9)):
        follow.offset_factor = share
        follow.keyframe_insert("offset_factor", frame=frame)
    return data


def _handle(_rig, path) -> None:
    point = path.splines[0].bezier_points[1]
    point.handle_right_type, point.handle_right = "FREE", (1, 3, 0)


def _tilt(_rig, path) -> None:
    path.splines[0].bezier_points[1].tilt = 1.0


def _cyclic(_rig, path) -> None:
    path.splines[0].use_cyclic_u = True


def _twisted(_rig, path) -> None:
    path.splines[0].bezier_points[1].tilt = 0.5
    path.splines[0].tilt_interpolation = "EASE"


def _turned_in_another_mode(rig, _) -> None:
    rig.pose.bones["spine"].rotation_mode = "ZYX"


def _at_rest(rig, _) -> None:
    rig.data.pose_position = "REST"


def _object_turned(rig) -> None:
    rig.rotation_euler = (0.3, 0.4, 0.5)


def _turned_in_another_mode_as_a_whole(rig, _) -> None:
    rig.rotation_mode = "ZYX"


def _ground(rig):
    """A ground that the rig is later put on."""
    mesh = bpy.data.meshes.new("Ground")
    mesh.from_pydata([(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], [], [(0, 1, 2, 3)])
    ground = bpy.data.objects.new("Ground", mesh)
    bpy.context.scene.collection.objects.link(ground)
    wrap = rig.constraints.new("SHRINKWRAP")
    wrap.target = ground
    for frame, share in ((8, 0), (9, 1)):
        wrap.influence = share
        wrap.keyframe_insert("influence", frame=frame)
    return mesh


def _raised(_rig, ground) -> None:
    for vertex in ground.vertices:
        vertex.co.z = 0.5 + 0.3 * vertex.co.x
    ground.update()


def _long_ground(rig):
    """A ground of many vertices on which the rig goes, with a modifier that does nothing yet where the rig is between the frames 14
    and 19.
    """
    rows = [(0.01 * k - 0.5, side, 0) for k in range(200) for side in (-2, 2)]
    mesh = bpy.data.meshes.new("Ground")
    mesh.from_pydata(rows, [], [(k, k + 1, k + 3, k + 2) for k in range(0, 398, 2)])
    ground = bpy.data.objects.new("Ground", mesh)
    bpy.context.scene.collection.objects.link(ground)
    wrap = rig.constraints.new("SHRINKWRAP")
    wrap.target, wrap.shrinkwrap_type, wrap.use_project_opposite = ground, "PROJECT", True
    wrap.project_axis, wrap.project_axis_space = "NEG_Z", "WORLD"
    ground.vertex_groups.new(name="Bump").add(_passed(mesh), 1, "REPLACE")
    bump = ground.modifiers.new("Bump", "DISPLACE")
    bump.strength, bump.vertex_group, bump.mid_level = 0, "Bump", 0
    return mesh


def _passed(mesh) -> list[int]:
    return [vertex.index for vertex in mesh.vertices if abs(vertex.co.x - 0.2) < 0.02]


def _sculpted(_rig, ground) -> None:
    for number in _passed(ground) or range(4):
        ground.vertices[number].co.z += 0.4
    ground.update()


def _displaced(_rig, _ground) -> None:
    bpy.data.objects["Ground"].modifiers["Bump"].strength = 0.4


def _keyed_ground(rig):
    mesh = _long_ground(rig)
    ground = bpy.data.objects["Ground"]
    ground.shape_key_add(name="Basis")
    bump = ground.shape_key_add(name="Bump")
    bump.value = 0.0
    for number in _passed(mesh):
        bump.data[number].co.z = 0.4
    return bump


def _shaped(_rig, bump) -> None:
    bump.value = 1.0


def _saddle(rig):
    """A saddle that another rig moves by a modifier alone, only between the frames 14 and 19, and on whose vertices the rig rides."""
    horse = scenes.armature("Horse", [("root", "", (0, 0, 0), (0, 0, 0.5))])
    curve = horse.pose.bones["root"].driver_add("location", 0)
    curve.driver.expression = "0.3 * sin(frame) if 14 < frame < 19 else 0"
    mesh = bpy.data.meshes.new("Saddle")
    mesh.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0)], [], [(0, 1, 2)])
    saddle = bpy.data.objects.new("Saddle", mesh)
    bpy.context.scene.collection.objects.link(saddle)
    saddle.vertex_groups.new(name="root").add([0, 1, 2], 1, "REPLACE")
    saddle.modifiers.new("Armature", "ARMATURE").object = horse
    rig.parent, rig.parent_type, rig.parent_vertices = saddle, "VERTEX_3", [0, 1, 2]
    bpy.context.view_layer.update()
    return curve.driver


def _still(_rig, driver) -> None:
    driver.expression = "0"
