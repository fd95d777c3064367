# SPDX-License-Identifier: GPL-3.0-or-later
"""Keyframes on exactly the hair bones, in an action of their own that can be muted."""

import bpy
import numpy as np

from . import rotations

TRACK = "Neuralocks Hair"
KEPT = "neuralocks_rotations"
"""Property of the action with how the hair bones were turned before."""


def bake_keys(armature, bones, frames: np.ndarray, turns: np.ndarray):
    """Key the rotations of the hair bones and put them on a strip above all other animation.

    Args:
        armature: the armature object.
        bones: bone names, (N).
        frames: (T,).
        turns: (T, N, 4) wxyz.

    Returns:
        the action.
    """
    remove(armature)
    data = armature.animation_data or armature.animation_data_create()
    action = bpy.data.actions.new(f"{armature.name} Hair")
    action[KEPT] = rotations.kept(armature, bones)
    curves = _curves(action, armature)
    smooth = _continuous(turns)
    for column, name in enumerate(bones):
        armature.pose.bones[name].rotation_mode = "QUATERNION"
        path = f'pose.bones["{bpy.utils.escape_identifier(name)}"].rotation_quaternion'
        for index in range(4):
            curve = _new_curve(curves, path, index, name)
            curve.keyframe_points.add(len(frames))
            values = np.empty((len(frames), 2), np.float32)
            values[:, 0], values[:, 1] = frames, smooth[:, column, index]
            curve.keyframe_points.foreach_set("co", values.ravel())
            for point in curve.keyframe_points:
                point.interpolation = "LINEAR"
            curve.update()
    track = data.nla_tracks.new()
    track.name = TRACK
    strip = track.strips.new(action.name, int(frames[0]), action)
    strip.blend_type, strip.extrapolation = "REPLACE", "HOLD"
    return action


def has_keys(armature) -> bool:
    """Whether its hair bones are baked."""
    return armature.animation_data is not None and TRACK in armature.animation_data.nla_tracks


def remove(armature) -> bool:
    """Take an earlier bake off and turn the bones as they were before it; whether there was one."""
    if not has_keys(armature):
        return False
    data = armature.animation_data
    track = data.nla_tracks[TRACK]
    actions = [s.action for s in track.strips if s.action]
    data.nla_tracks.remove(track)
    for action in actions:
        rotations.give_back(armature, action.get(KEPT, ""))
        if not action.users:
            bpy.data.actions.remove(action)
    return True


def _continuous(turns: np.ndarray) -> np.ndarray:
    """The same rotations without sign flips between frames, which linear curves would swing through."""
    result = np.array(turns, float)
    flips = np.cumprod(np.where((result[1:] * result[:-1]).sum(axis=-1) < 0, -1.0, 1.0), axis=0)
    result[1:] *= flips[..., None]
    return result


def _curves(action, armature):
    """Where F-curves go: in Blender 4.4 and later into a channel bag of the action's slot for this armature."""
    if not hasattr(action, "slots"):
        return action.fcurves
    slot = action.slots.new("OBJECT", armature.name)
    layer = action.layers.new("Hair")
    return layer.strips.new(type="KEYFRAME").channelbag(slot, ensure=True).fcurves


def _new_curve(curves, path: str, index: int, group: str):
    """A curve in a group of its bone; how the group is named has changed twice."""
    for named in ({"group_name": group}, {"action_group": group}, {}):
        try:
            return curves.new(path, index=index, **named)
        except TypeError:
            continue
    raise RuntimeError(f"no F-curve for {path}")
