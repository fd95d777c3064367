# SPDX-License-Identifier: GPL-3.0-or-later
"""What makes up a rig's motion: strips, drivers, constraints, parents, the rest pose. When one of these is edited,
Blender only reports that the object has changed, as it does when a bone is posed; for keys it names the action.
"""

import re
import zlib

import bpy
import numpy as np

from ..character.body import up_to_armature, weighed_so
from ..keys.hair_keys import HAIR, as_before
from ..objects import records
from ..objects.animated import animated, curves_of, strips_of, targets_of, written
from ..objects.settings import as_set, objects_named, settings_of
from .ground_shapes import shape
from .unkeyed_poses import PLACE, value_of

REST = {"matrix_local": 16, "use_inherit_rotation": 1, "use_local_location": 1, "use_deform": 1}
IK = ("ik_stretch", *(f"ik_{end}_{axis}" for end in ("min", "max", "stiffness") for axis in "xyz"))
LIMITED = tuple(f"{what}_{axis}" for what in ("use_ik_limit", "lock_ik") for axis in "xyz")
"""Settings of bones that posing does not change."""
DELTA = ("delta_location", "delta_rotation_euler", "delta_rotation_quaternion", "delta_scale")
"""What adds to an object's own channels, PLACE."""
_ONE = re.compile(r"(?:\[(\d+)\]|\.[wxyz])$")
"""How the path of one number of several ends; curves name all of them, and the number beside."""


def rigging(things) -> int:
    """A number that changes when the setup of one of these objects, or of one that it depends on, changes."""
    others = reached(things)[len(things) :]
    shaping = [_shaped_by(thing) for thing in things if thing.type == "MESH"]
    found = [*map(_object, things), *shaping, *([*_object(thing), *_modifiers(thing)] for thing in others)]
    return records.number_of(found)


def posture(things) -> int:
    """A number that changes when one of these objects, or one that it depends on, is placed or posed differently by values that no
    animation writes: these count in all frames. Hair bones count as they are without the hair's motion; the shape counts of what they
    depend on, but not their own.
    """
    others = reached(things)[len(things) :]
    found = [*map(_held, things), *([*_held(thing), *shape(thing)] for thing in others)]
    return records.number_of(found)


def unreported(body) -> int:
    """A number that changes when the shape, the weights or the keyed shape of a body are edited: Blender reports nothing of that where
    it does not evaluate the body.
    """
    keys = body.data.shape_keys
    curves = curves_of(keys.animation_data) if keys else ()
    found = [*shape(body), *((curve.data_path, number_of_keys(curve)) for curve in curves), weighed_so(body)]
    if keys:
        still = [name for name in ("use_relative", "eval_time") if name not in animated(keys.animation_data)]
        found += [*as_set(keys, still), [block.frame for block in keys.key_blocks]]
    return records.number_of(found)


def reached(things) -> list:
    """These objects, and then those on whose place, pose or shape they depend. Modifiers of hair move no object."""
    found = {thing.name_full: thing for thing in things}
    waiting = list(found.values())
    while waiting:
        thing = waiting.pop()
        bones = thing.pose.bones if thing.pose else ()
        others = [thing.parent]
        if thing.type != "CURVES":
            others += [other for modifier in thing.modifiers for other in objects_named(modifier)]
        for constraint in [*thing.constraints, *(c for bone in bones for c in bone.constraints)]:
            others += objects_named(constraint)
            others += [target.target for target in getattr(constraint, "targets", ())]
        others += [target.id for data in _animation(thing) for _, target in targets_of(data)]
        for other in others:
            if isinstance(other, bpy.types.Object) and other.name_full not in found:
                found[other.name_full] = other
                waiting.append(other)
    return list(found.values())


def hangs(thing) -> list:
    """How an object hangs on its parent, whichever that is."""
    inverse = (row[:] for row in thing.matrix_parent_inverse)
    return [thing.parent is None, thing.parent_type, thing.parent_bone, *inverse]


def stands(thing, moving: set[str]) -> list:
    """An object's own place, without the paths that animation writes, `moving`."""
    return [getattr(thing, name)[:] for name in (*PLACE, *DELTA) if name not in moving]


def number_of_keys(curve) -> int:
    """A number of a curve's keys: a face has a hundred thousand."""
    values = np.empty((3, 2 * len(curve.keyframe_points)), np.float32)
    for row, name in zip(values, ("co", "handle_left", "handle_right"), strict=True):
        curve.keyframe_points.foreach_get(name, row)
    return zlib.crc32(values)


def _animation(thing) -> list:
    """Animation data of an object, its data and its shape keys."""
    owners = (thing, thing.data, getattr(thing.data, "shape_keys", None))
    return [data for owner in owners if (data := getattr(owner, "animation_data", None))]


def _object(thing) -> list:
    moving = animated(thing.animation_data)
    found = [thing.name_full, thing.parent and thing.parent.name_full, *hangs(thing)]
    found += [_constraint(c, f'constraints["{_quoted(c)}"].', moving) for c in thing.constraints]
    found += [_numbers(thing, "", moving), *(_animated_by(data) for data in _animation(thing))]
    if thing.pose is not None:
        found += [_channels(thing.data.bones, REST), _channels(thing.pose.bones, dict.fromkeys((*IK, *LIMITED), 1))]
        found.append(thing.pose.ik_solver)
        for bone in thing.pose.bones:
            start = f'pose.bones["{_quoted(bone)}"]'
            found += [bone.name, bone.bone.inherit_scale, bone.parent and bone.parent.name]
            found.append(_numbers(bone, start, moving))
            found += [_constraint(c, f'{start}.constraints["{_quoted(c)}"].', moving) for c in bone.constraints]
    return found


def _held(thing) -> list:
    moving, live = animated(thing.animation_data, HAIR), as_before(thing)
    found = [*stands(thing, moving), _mode(thing, "", moving), _lists(thing, "", moving)]
    found += [_read(data) for data in _animation(thing)]
    if thing.pose is not None:
        bones = thing.pose.bones
        found.append(thing.data.pose_position)
        starts = [f'pose.bones["{_quoted(bone)}"].' for bone in bones]
        for name, size in PLACE.items():
            values = np.empty((len(bones), size), np.float32)
            bones.foreach_get(name, values.ravel())
            for row, bone in enumerate(bones):
                if starts[row] + name in moving:
                    values[row] = 0
                elif bone.name in live:
                    values[row] = live[bone.name].get(name, values[row])
            found.append(zlib.crc32(values))
        for bone, start in zip(bones, starts, strict=True):
            found += [_mode(bone, start, moving, live.get(bone.name, {})), _lists(bone, start[:-1], moving)]
    return found


def _mode(owner, start: str, moving: set[str], live=()) -> str:
    """The rotation mode of an object or a bone; as in `live`, if it is there."""
    if f"{start}rotation_mode" in moving:
        return ""
    return live["rotation_mode"] if "rotation_mode" in live else owner.rotation_mode


def _lists(owner, start: str, moving: set[str]) -> list:
    """Lists of numbers among the custom properties that no animation writes; `rigging` covers single ones."""
    return [
        (key, value.to_list())
        for key, value in owner.items()
        if hasattr(value, "to_list") and _custom(start, key) not in moving
    ]


def _read(data) -> list:
    """What drivers read, and no animation writes, of anything but objects' places."""
    found, known = [], {}  # hundreds of drivers may read one rig
    for variable, target in targets_of(data):
        path, owner = target.data_path, target.id
        if variable.type == "CONTEXT_PROP":  # of the scene or the view layer that is shown
            owner = bpy.context.scene if target.context_property == "ACTIVE_SCENE" else bpy.context.view_layer
        # What the frame is belongs to each frame, as in drivers that name it without a variable.
        if not path or owner is None or isinstance(owner, bpy.types.Scene) and path.startswith("frame_"):
            continue
        if owner not in known:
            known[owner] = written(getattr(owner, "animation_data", None))
        if not _written(path, known[owner]):
            found.append(value_of(owner, path))
    return found


def _written(path: str, known: set[tuple[str, int]]) -> bool:
    """Whether animation writes what is at a path, which may be one number of several."""
    one = _ONE.search(path)
    if one and one[1]:
        return (path[: one.start()], int(one[1])) in known or (path, 0) in known
    return any(each in (path, path[: one.start()] if one else path) for each, _ in known)


def _channels(bones, names: dict[str, int]) -> list[int]:
    found = []
    for name, size in names.items():
        values = np.empty(len(bones) * size, bool if name.startswith(("use_", "lock_")) else np.float32)
        bones.foreach_get(name, values)
        found.append(zlib.crc32(values))
    return found


def _numbers(owner, start: str, moving: set[str]) -> list:
    """Numbers among the custom properties that no animation writes, such as switches between IK and FK."""
    return [
        (key, value)
        for key, value in owner.items()
        if isinstance(value, (int, float)) and _custom(start, key) not in moving
    ]


def _custom(start: str, key: str) -> str:
    """The path of a custom property."""
    return f'{start}["{bpy.utils.escape_identifier(key)}"]'


def _constraint(constraint, start: str, moving: set[str]) -> list:
    still = [name for name in (*settings_of(constraint), "influence") if start + name not in moving]
    several = [(t.target and t.target.name_full, t.subtarget) for t in getattr(constraint, "targets", ())]
    return [constraint.name, constraint.type, several, *as_set(constraint, still)]


def _shaped_by(body) -> list:
    """What deforms a body: modifiers, and the names by which bones find its vertices, which Blender does not report."""
    return [*_modifiers(body, up_to_armature(body)), *(group.name for group in body.vertex_groups)]


def _modifiers(thing, some=None) -> list:
    """Modifiers, all or some, without what animation writes."""
    moving, found = animated(thing.animation_data), []
    for modifier in thing.modifiers if some is None else some:
        start = f'modifiers["{_quoted(modifier)}"].'
        still = [name for name in settings_of(modifier) if start + name not in moving]
        found += [modifier.name, modifier.type, *as_set(modifier, still)]
    return found


def _animated_by(data) -> list:
    """Action, strips and drivers."""
    found = as_set(data, settings_of(data))
    for track in data.nla_tracks:
        if track.name not in HAIR or track.is_solo:
            found += [track.name, track.mute, track.is_solo]
    for strip in strips_of(data, HAIR):
        found += [strip.name, *as_set(strip, settings_of(strip)), *(shape_of(curve) for curve in strip.fcurves)]
    for curve in data.drivers:
        if _of_hair(curve):
            continue
        driver = curve.driver
        found += [curve.data_path, curve.array_index, curve.mute, shape_of(curve), driver.type, driver.expression]
        for variable in driver.variables:
            found += [variable.name, variable.type]
            found += [part for target in variable.targets for part in as_set(target, settings_of(target))]
    return found


def _of_hair(curve) -> bool:
    """Whether a driver sets a modifier of hair, which moves no rig, and may be muted while the hair is live."""
    owner = curve.id_data
    return isinstance(owner, bpy.types.Object) and owner.type == "CURVES" and curve.data_path.startswith("modifiers[")


def shape_of(curve) -> list:
    """Modifiers and keys of a curve, also of one that shapes what a driver gives."""
    modifiers = [[modifier.type, *as_set(modifier, settings_of(modifier))] for modifier in curve.modifiers]
    return [*modifiers, *((*key.co, key.interpolation) for key in curve.keyframe_points)]


def _quoted(named) -> str:
    return bpy.utils.escape_identifier(named.name)
