# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations of bones, put aside as text while something else turns these bones, and given back as they were."""

import json


def kept(armature, bones) -> str:
    """Rotation modes, and the values of every mode, of the bones named, as JSON."""
    found = {}
    for name in bones:
        bone = armature.pose.bones[name]
        found[name] = [
            bone.rotation_mode,
            list(bone.rotation_quaternion),
            list(bone.rotation_euler),
            list(bone.rotation_axis_angle),
        ]
    return json.dumps(found)


def give_back(armature, text: str) -> bool:
    """Turn bones as `kept` found them, those that are still there; whether there was anything to give back."""
    try:
        found = json.loads(text or "{}")
    except json.JSONDecodeError:
        found = {}
    for name, (mode, quaternion, euler, axis_angle) in found.items():
        bone = armature.pose.bones.get(name) if armature.pose else None
        if bone is not None:
            bone.rotation_mode = mode  # first, as it writes the values of its mode from those of the last one
            bone.rotation_quaternion, bone.rotation_euler, bone.rotation_axis_angle = quaternion, euler, axis_angle
    if found:
        armature.update_tag()
    return bool(found)
