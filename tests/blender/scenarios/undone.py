# SPDX-License-Identifier: GPL-3.0-or-later
"""What undo and redo do to a sampled motion: Blender reports everything as edited after each."""

from pathlib import Path
from unittest import SkipTest
from unittest.mock import patch

import bpy

from tests.blender import scenes
from tests.blender.checks import make_live


def _sampled():
    """The motion of the rig, once what was edited is known."""
    from dcc_addon.session import session

    bpy.context.view_layer.update()
    return session.rigs["Rig"]


def _begin(rig) -> None:
    if bpy.app.version < (4, 0):
        raise SkipTest("without a window, older ones keep no undo steps")
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.name = "Prop"
    for frame in (1, 24):  # keys of meshes may move whatever node groups name
        bpy.context.object.keyframe_insert("location", frame=frame)
    make_live(rig, bpy.data.objects["Hair"])
    bpy.ops.ed.undo_push(message="begun")


def undone_beside(_folder: Path) -> None:
    """An undo of what moves no rig leaves the motion as it was sampled; so does a redo, and with shape keys, too."""
    rig, _ = scenes.dancer_with_shapes()
    _begin(rig)
    first = _sampled()
    changes = (
        lambda: setattr(bpy.data.objects["Prop"], "scale", (1, 2, 3)),
        lambda: setattr(bpy.data.objects["Hair"].neuralocks_hair, "motion", 0.3),
        lambda: setattr(bpy.data.objects["Rig"].pose.bones["neck"], "scale", (1, 1, 1.5)),
        lambda: bpy.ops.mesh.primitive_cube_add(),
    )
    for change in changes:
        change()
        bpy.context.view_layer.update()
        bpy.ops.ed.undo_push(message="beside")
        for step in (bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.undo):
            step()
            assert _sampled() is first and not first.stale, (change, step)


def undone_after_unseen_edit(_folder: Path) -> None:
    """A script's edit of a key that Blender has not evaluated before an undo of something else puts the motion out of date."""
    rig, _ = scenes.dancer_with_shapes()
    _begin(rig)
    assert not _sampled().stale
    action = bpy.data.objects["Rig"].animation_data.action
    scenes.fcurves(bpy.data.objects["Rig"])[0].keyframe_points[1].co[1] += 0.2
    action.update_tag()
    bpy.ops.ed.undo_push(message="edited")
    bpy.data.objects["Prop"].scale = 1, 2, 3
    bpy.ops.ed.undo_push(message="beside")
    bpy.ops.ed.undo()
    assert _sampled().stale


def undone_edit(_folder: Path) -> None:
    """An undo of an edit of keys or of the body puts a motion that was sampled since out of date, whatever the edit was."""
    rig, _ = scenes.dancer_with_shapes()
    _begin(rig)
    curve = next(c for c in scenes.fcurves(rig) if len(c.keyframe_points) > 2)
    number = scenes.fcurves(rig).index(curve)

    def key():
        return scenes.fcurves(bpy.data.objects["Rig"])[number].keyframe_points[1]

    def skin():
        return bpy.data.objects["Body"]

    changes = {
        "value": lambda: setattr(key(), "co", (key().co[0], key().co[1] + 0.2)),
        "interpolation": lambda: setattr(key(), "interpolation", "CONSTANT"),
        "extrapolation": lambda: setattr(scenes.fcurves(bpy.data.objects["Rig"])[number], "extrapolation", "LINEAR"),
        "muted": lambda: setattr(scenes.fcurves(bpy.data.objects["Rig"])[number], "mute", True),
        "modifier": lambda: scenes.fcurves(bpy.data.objects["Rig"])[number].modifiers.new("NOISE"),
        "weight": lambda: skin().vertex_groups[0].add([7], 0.25, "REPLACE"),
        "faces": lambda: skin().data.flip_normals(),
        "shape": lambda: setattr(skin().data.shape_keys.key_blocks["Keyed"].data[3], "co", (0.5, 0.5, 0.5)),
        "relative": lambda: setattr(skin().data.shape_keys, "use_relative", False),
        "held": lambda: setattr(skin().data.shape_keys.key_blocks["Held"], "value", 0.9),
    }
    for what, change in changes.items():
        change()
        for data in (bpy.data.objects["Rig"].animation_data.action, skin().data, skin()):
            data.update_tag()
        with patch("dcc_addon.scene.character.body.PROBES", 2):
            assert _sampled().stale, what
            assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
            assert not _sampled().stale, what
            bpy.ops.ed.undo_push(message=what)
            bpy.ops.ed.undo()
            assert _sampled().stale, what
            assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
