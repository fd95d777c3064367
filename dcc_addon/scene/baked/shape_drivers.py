# SPDX-License-Identifier: GPL-3.0-or-later
"""What drives the shape keys of a mesh, as a number."""

import re

import bpy

from ..motion.rigging import shape_of
from ..objects.animated import is_muted
from ..objects.records import number_of

_MEMBER = re.compile(r'(\w)\["((?:\\.|[^"\\])*)"\]')
"""A bone or the like in a path. Blender writes another name there if it gets one; custom properties are named without a word before."""


def number_of_drivers(mesh) -> int:
    """A number that changes when drivers of the shape keys of a mesh do, or the rest places of bones that they read; 0 if there are none.
    Names of what they read count for nothing, so another object of the same type, or another member that is no bone, is not told.
    """
    shapes = mesh.shape_keys
    data = shapes.animation_data if shapes else None
    curves = [curve for curve in data.drivers if not is_muted(curve)] if data else []
    paths = [block.path_from_id("value") for block in shapes.key_blocks] if curves else []
    return number_of([_driver(curve, paths) for curve in curves]) if curves else 0


def _driver(curve, paths: list[str]) -> list:
    driver = curve.driver
    driven = paths.index(curve.data_path) if curve.data_path in paths else -1
    read = ([each.name, each.type, *map(_target, each.targets)] for each in driver.variables)
    return [driven, driver.type, driver.expression, driver.use_self, shape_of(curve), *read]


def _target(target) -> list:
    read = target.id
    bones = read.data.bones if isinstance(read, bpy.types.Object) and read.type == "ARMATURE" else {}

    def place(name: str) -> list | bool:
        bone = bones.get(name)
        return [round(value, 5) for value in bone.head_local] if bone else bool(name)

    return [
        getattr(read, "type", target.id_type),
        _MEMBER.sub(lambda found: f"{found[1]}{place(bpy.utils.unescape_identifier(found[2]))}", target.data_path),
        place(target.bone_target),
        target.transform_type,
        target.transform_space,
        target.rotation_mode,
    ]
