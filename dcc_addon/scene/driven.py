# SPDX-License-Identifier: GPL-3.0-or-later
"""What drives the shape keys of a mesh, as a number."""

import re

import bpy

from .animated import is_muted
from .recorded import number_of

_MEMBER = re.compile(r'(\w)\["(?:\\.|[^"\\])*"\]')
"""A bone or the like in a path. Blender writes another name there if it gets one; custom properties are named without a word before."""


def number_of_drivers(mesh) -> int:
    """A number that changes when drivers of the shape keys of a mesh do; 0 if there are none. Names of what they read count for nothing."""
    data = mesh.shape_keys.animation_data if mesh.shape_keys else None
    curves = [curve for curve in data.drivers if not is_muted(curve)] if data else []
    return number_of([_driver(curve) for curve in curves]) if curves else 0


def _driver(curve) -> list:
    driver = curve.driver
    scaled = [(each.type, each.mute, *getattr(each, "coefficients", ())) for each in curve.modifiers]
    return [driver.type, driver.expression, scaled, *map(_variable, driver.variables)]


def _variable(variable) -> list:
    return [variable.name, variable.type, *map(_target, variable.targets)]


def _target(target) -> list:
    read = target.id
    bones = read.data.bones if isinstance(read, bpy.types.Object) and read.type == "ARMATURE" else {}
    bone = bones.get(target.bone_target)
    return [
        getattr(read, "type", target.id_type),
        _MEMBER.sub(r"\1[]", target.data_path),
        [round(value, 5) for value in bone.head_local] if bone else bool(target.bone_target),
        target.transform_type,
        target.transform_space,
        target.rotation_mode,
    ]
