# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scenarios share: hair made live, its points and its bones as they are shown, and its points as they are baked."""

import os
from unittest import SkipTest
from unittest.mock import patch

import bpy
import numpy as np

from tests.blender import scenes

MODEL = os.environ.get("NEURALOCKS_TEST_MODEL", "")
SAME = 1e-5
"""Points nearer to each other than this [m] are the same."""


def make_live(rig, strands, **look):
    """Make the hair live on a sampled rig."""
    scene = bpy.context.scene
    scene.neuralocks.armature, scene.neuralocks.hair = rig, strands
    strands.neuralocks_hair.armature = rig
    strands.neuralocks_hair.model = MODEL
    for name, value in look.items():
        setattr(strands.neuralocks_hair, name, value)
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    strands.neuralocks_hair.live = True


def give_bone_model(rig, folder):
    """Sample a rig, and give its hair bones a model of random weights, stored in the folder."""
    bpy.context.scene.neuralocks.armature = rig
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    rig.neuralocks_character.rig_model = str(scenes.rig_model(rig, folder / "rig.neuralocks"))


def messages():
    """The problems that the panel shows, by object name."""
    from dcc_addon.session import session

    return session.said.messages


def refused(call, *words):
    """The call raises an error with all these words, as operators that refuse do, and not an unexpected one."""
    try:
        result = call()
    except Exception as error:
        text = str(error)
        assert "unexpected" not in text, text
        assert all(word in text for word in words), text
    else:
        raise AssertionError(f"not refused: {result}")


def told_by(operator, **options) -> list[str]:
    """What a bake operator reports besides that it is done."""
    with patch("dcc_addon.operators.bake.tell") as tell:
        assert operator(**options) == {"FINISHED"}
    return tell.call_args.args[2]


def needs_usd():
    """Ends the scenario if this Blender was built without USD, as Debian's is."""
    if not getattr(bpy.app.build_options, "usd", False):
        raise SkipTest("no USD in this Blender")


def points_at(strands, frame, subframe=0.0):
    """Points (P, 3) of a hair object at a frame, as it is drawn."""
    bpy.context.scene.frame_set(frame, subframe=subframe)
    return scenes.points(strands)


def bones_at(rig, frame, names=None):
    """Matrices (J, 4, 4) of the bones of these names, or of all, at a frame, as they are drawn, in the rig's space."""
    bpy.context.scene.frame_set(frame)
    pose = rig.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose
    return np.array([np.array(bone.matrix) for bone in pose.bones if names is None or bone.name in names])


def baked_points(path, prim, frame):
    """Points (P, 3) of a groom at a frame, in the world of a baked stage."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath(prim))
    points = np.array(curves.GetPointsAttr().Get(frame), float)
    matrix = np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(curves.GetPrim())).T
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def body_sampled(rig, body) -> int:
    """Compares the body of the sampled character with the evaluated mesh; its number of vertices."""
    from dcc_addon.services.rigs.axes import to_core
    from dcc_addon.session import session
    from neuralocks_core.rotation import transformed

    scene = bpy.context.scene
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    sampled = session.rigs[rig.name]
    for frame in (1, 9):
        scene.frame_set(frame)
        evaluated = body.evaluated_get(bpy.context.evaluated_depsgraph_get())
        drawn = np.array([v.co[:] for v in evaluated.data.vertices])
        drawn = transformed(transformed(drawn, np.array(evaluated.matrix_world)), to_core())
        row = sampled.motion.row(frame)
        ours = sampled.character.posed_body(
            sampled.clip.joints[row], sampled.clip.shape_at([sampled.clip.times[row]])[0]
        )
        assert len(ours) == len(drawn) and np.abs(ours - drawn).max() < 2e-4, (len(ours), len(drawn), frame)
    return len(drawn)


def apart(a, b):
    """Largest difference of two arrays of the same shape."""
    assert a.shape == b.shape
    return float(np.abs(a - b).max())


def choose(thing):
    """Select an object alone, and make it the active one."""
    for other in bpy.data.objects:
        other.select_set(other == thing)
    bpy.context.view_layer.objects.active = thing


def own_handlers():
    """Handlers of the add-on on any of Blender's lists."""
    lists = (getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers))
    return [
        f for calls in lists if isinstance(calls, list) for f in calls if "dcc_addon" in getattr(f, "__module__", "")
    ]
