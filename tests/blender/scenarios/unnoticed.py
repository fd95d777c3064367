# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of what moves a rig in other frames than the one that is shown, of which Blender tells nothing."""

import math
from pathlib import Path
from unittest.mock import patch

import bpy

from tests.blender import scenes
from tests.blender.checks import apart, make_live, messages, points_at

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


def many_drivers(_folder: Path) -> None:
    """However many drivers read a rig, what animates it is listed as often as for one: in a control rig with hundreds of them, each
    look at the unkeyed values would otherwise block Blender for seconds.
    """
    from dcc_addon.scene.animated import animated
    from dcc_addon.scene.sampling import posture_of

    rig, scene = scenes.armature(), bpy.context.scene
    rig["switch"] = 0.5
    bones, listed = list(rig.pose.bones), []
    for count in (1, len(bones)):
        for bone in bones[:count]:
            bone.driver_remove("location")
            for curve in bone.driver_add("location"):
                read = curve.driver.variables.new().targets[0]
                read.id, read.data_path = rig, '["switch"]'
        with patch("dcc_addon.scene.rigging.animated", wraps=animated) as listing:
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
