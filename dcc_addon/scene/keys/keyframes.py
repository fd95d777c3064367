# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations of bones as an action with keyframes, and its place among an armature's NLA tracks."""

import bpy
import numpy as np

from . import rotations

LINEAR = bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items["LINEAR"].value
"""The number of this interpolation: that of many keys is written at once by numbers only."""


def keyed_action(armature, label: str, modes: dict[str, str], frames: np.ndarray, turns: np.ndarray):
    """A new action that turns bones.

    Args:
        armature: for which it is.
        label: its name.
        modes: the rotation mode of each bone, by name (N).
        frames: of the keys (T,), ascending.
        turns: rotations (T, N, 4) wxyz there.
    """
    if frames[0] % 1:  # a strip begins at a whole frame
        frames, turns = np.append(np.floor(frames[0]), frames), np.concatenate([turns[:1], turns])
    action = bpy.data.actions.new(label)
    curves = _curves(action, armature)
    for column, (name, mode) in enumerate(modes.items()):
        path = f'pose.bones["{bpy.utils.escape_identifier(name)}"].{rotations.CHANNELS[mode]}'
        for index, values in enumerate(rotations.values(mode, turns[:, column]).T):
            curve = _new_curve(curves, path, index, name)
            curve.keyframe_points.add(len(frames))
            keys = np.stack([frames, values], axis=1).astype(np.float32)
            curve.keyframe_points.foreach_set("co", keys.ravel())
            curve.keyframe_points.foreach_set("interpolation", np.full(len(frames), LINEAR, np.int32))
            curve.update()
    return action


def put_on_top(data, name: str, action) -> None:
    """Put an action on a new NLA track with this name, above all others; `data` is the armature's animation data."""
    track = data.nla_tracks.new()
    track.name = name
    strip = track.strips.new(action.name, int(action.frame_range[0]), action)
    strip.blend_type, strip.extrapolation = "REPLACE", "HOLD"


def _curves(action, armature):
    """Where F-curves go: in Blender 4.4 and later, into a channel bag of the action's slot for this armature."""
    if not hasattr(action, "slots"):
        return action.fcurves
    slot = action.slots.new("OBJECT", armature.name)
    layer = action.layers.new("Hair")
    return layer.strips.new(type="KEYFRAME").channelbag(slot, ensure=True).fcurves


def _new_curve(curves, path: str, index: int, group: str):
    """A new curve in its bone's group; the API for naming the group has changed twice."""
    for named in ({"group_name": group}, {"action_group": group}, {}):
        try:
            return curves.new(path, index=index, **named)
        except TypeError:
            continue
    raise RuntimeError(f"no F-curve for {path}")
