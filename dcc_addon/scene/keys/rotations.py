# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations of bones, stored as text while something else turns these bones, and restored exactly."""

import json
from functools import lru_cache

import bpy
import numpy as np
from mathutils import Euler, Quaternion

from neuralocks_core.errors import NeuralocksError

from ..objects.animated import animated
from ..objects.stored_values import are_numbers, remembered

SAME = 1e-7
"""Values that differ by less than this are the same turn."""
SAME_PLACE = 1e-5
"""Places that differ by less than this, in the armature's unit, are the same."""
CHANNELS = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle", "XYZ": "rotation_euler"}
"""Rotation mode -> the property in which a bone keeps its rotation."""
MODES = ("QUATERNION", "AXIS_ANGLE", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
"""All rotation modes of Blender."""
KEPT = ("rotation_mode", "rotation_quaternion", "rotation_euler", "rotation_axis_angle")
"""What is stored of a bone."""
KEYED = ("QUATERNION", "XYZ", "AXIS_ANGLE")
"""Modes for keys, best first: the axis of a small turn is arbitrary, so it swings between two keys."""


def kept(armature, bones) -> str:
    """Rotation modes, and the values of every mode, of the named bones that exist, as JSON: KEPT of each, its place at rest, which
    identifies it under another name, and the modes that animation writes.
    """
    found, written = {}, animated(armature.animation_data)
    for name in bones:
        bone = armature.pose.bones.get(name)
        if bone is not None:
            mode, *channels = KEPT
            values = (list(getattr(bone, channel)) for channel in channels)
            found[name] = [getattr(bone, mode), *values, _place(bone), _modes(bone, written)]
    return json.dumps(found)


def kept_in(text: str) -> dict[str, list]:
    """What `kept` stored, by bone; without values that it never writes."""
    return dict(_read(text)) if isinstance(text, str) else {}


@lru_cache(16)
def _read(text: str) -> dict[str, list]:
    return remembered(text, _fits)  # of hundreds of bones, and asked for in every frame


def joined(newer: str, older: str) -> str:
    """What `kept` stored at two times, as one text; of a bone in both, how it was at the earlier time."""
    return json.dumps(kept_in(newer) | kept_in(older))


def give_back(armature, text: str, keyed: bool = False, without=()) -> None:
    """Turn the bones that are still there as `kept` found them. With `keyed`, bones that animation has since begun to turn, as
    Blender's Bake Action does, are left to it, except that of NLA tracks of the names `without`.
    """
    found, written = kept_in(text), animated(armature.animation_data, without) if keyed else set()
    for name, (mode, quaternion, euler, axis_angle, place, modes) in found.items():
        bone = _bone(armature, name, place, found) if armature.pose else None
        if bone is not None and (since := _written_since(bone, mode, modes, written)):
            bone.rotation_mode = since
        elif bone is not None:
            bone.rotation_mode = mode  # first, because it converts the values from the previous mode
            bone.rotation_quaternion, bone.rotation_euler, bone.rotation_axis_angle = quaternion, euler, axis_angle
    if found:
        armature.update_tag()


def _fits(values: list) -> bool:
    """Whether `kept` writes such values of a bone."""
    if len(values) != len(KEPT) + 2:
        return False
    mode, *numbers, modes = values
    return (
        mode in MODES
        and all(map(are_numbers, numbers, (4, 3, 4, 6)))
        and isinstance(modes, list)
        and set(map(str, modes)) <= set(CHANNELS)
    )


def _modes(bone, written: set[str]) -> list[str]:
    """Modes of CHANNELS whose values are among the paths written."""
    return [mode for mode, channel in CHANNELS.items() if bone.path_from_id(channel) in written]


def _written_since(bone, mode: str, then: list[str], written: set[str]) -> str:
    """The mode in which animation, which then wrote others, turns a bone that it did not turn; empty if there is none."""
    found = _modes(bone, written)
    plays = mode in found or (mode not in CHANNELS and "XYZ" in found)  # all orders of Euler angles share one channel
    return "" if plays else next((each for each in found if each not in then), "")


def _place(bone) -> list[float]:
    """Where a bone is at rest, head and tail, in its armature's space."""
    return [*bone.bone.head_local, *bone.bone.tail_local]


def _bone(armature, name: str, place: list[float], found: dict):
    """The bone of this name; otherwise, since it may have been renamed, the only bone at `place` whose name is not in `found`."""
    bones = armature.pose.bones
    if name in bones:
        return bones[name]
    others = [bone for bone in bones if bone.name not in found]
    there = [bone for bone in others if np.abs(np.subtract(_place(bone), place)).max() < SAME_PLACE]
    return there[0] if len(there) == 1 else None


def free_modes(armature, bones, modes=tuple(CHANNELS), without=()) -> dict[str, str]:
    """For each bone, the first rotation mode whose values no animation writes, except NLA tracks of the names `without`; the last
    one if all are animated.
    """
    written = animated(armature.animation_data, without)
    found = {}
    for name in bones:
        start = f'pose.bones["{bpy.utils.escape_identifier(name)}"].'
        found[name] = next((mode for mode in modes if start + CHANNELS[mode] not in written), modes[-1])
    return found


def check_free(armature, bones) -> None:
    """Refuse bones turned by anything other than their own and their parent's rotation, in any frame: hair would be turned twice.

    Raises:
        NeuralocksError: one has a constraint, or does not turn with its parent.
    """
    written = None  # many rigs have hundreds of curves, and few have constraints on hair bones
    for name in bones:
        bone = armature.pose.bones.get(name)
        if bone is None:  # renamed: whoever reads the pose reports that
            continue
        for constraint in bone.constraints:
            written = animated(armature.animation_data) if written is None else written
            keyed = constraint.path_from_id("mute") in written
            acts = constraint.influence or constraint.path_from_id("influence") in written
            if acts and (keyed or not constraint.mute):
                remedy = "remove the animation of its mute, then mute it" if keyed else "mute the constraint"
                raise NeuralocksError(
                    f"{armature.name_full}: hair bone '{name}' has the constraint '{constraint.name}', which would turn it a second "
                    f"time; {remedy}"
                )
        if not bone.bone.use_inherit_rotation:
            raise NeuralocksError(
                f"{armature.name_full}: hair bone '{name}' does not turn with its parent; turn on Inherit Rotation (bone "
                "properties, Relations)"
            )


def values(mode: str, turns: np.ndarray) -> np.ndarray:
    """A bone's values in a rotation mode (T, 3 or 4) for turns (T, 4) wxyz over time, without jumps that linear curves would swing
    through.
    """
    same = np.array(turns, float)
    same[1:] *= np.cumprod(np.where((same[1:] * same[:-1]).sum(axis=-1) < 0, -1.0, 1.0))[:, None]
    if mode == "QUATERNION":
        return same
    found, last = [], Euler()
    for wxyz in same:
        if mode == "XYZ":
            last = Quaternion(wxyz).to_euler("XYZ", last)
            found.append(last[:])
        else:
            found.append(_axis_angle(wxyz))
    return np.array(found)


def turn(bone, mode: str, wxyz) -> bool:
    """Turn a bone in a rotation mode; returns whether that changed anything."""
    wanted = np.array(wxyz, np.float32)
    if mode == "AXIS_ANGLE":
        wanted = np.array(_axis_angle(wxyz), np.float32)
    elif mode == "XYZ":
        wanted = np.array(Quaternion(wxyz).to_euler("XYZ"), np.float32)
    if bone.rotation_mode == mode and np.abs(np.subtract(getattr(bone, CHANNELS[mode]), wanted)).max() <= SAME:
        return False
    bone.rotation_mode = mode
    setattr(bone, CHANNELS[mode], wanted)
    return True


def _axis_angle(wxyz) -> list[float]:
    axis, angle = Quaternion(wxyz).to_axis_angle()
    return [angle, *axis]
