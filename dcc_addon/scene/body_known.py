# SPDX-License-Identifier: GPL-3.0-or-later
"""The bodies that hair is kept out of, as a number of a record; see `recorded`. The panel asks in every redraw, and looking for them in
a large scene, or reading a large one, takes longer than that may take: both are done again only after an edit.
"""

from ..session import session
from . import recorded
from .animated import animated, curves_of, is_muted
from .body import number_of, number_of_shape, weighed_so
from .carried import bodies_of
from .rigging import number_of_keys


def number_of_bodies(armature, scene) -> int | None:
    """A number that changes when the bodies of an armature become others, or one takes another shape, other weights or other keys of its
    shape keys. Names count for nothing. None if the scene has no mesh on the armature at all, as where hair alone was appended: nobody
    changed a body then.
    """
    chosen = armature.neuralocks_character.body
    key = armature.name_full, scene.name_full, chosen and chosen.name_full
    if key not in session.bodies:
        found = sorted(_number_of(body) for body in bodies_of(armature, scene))
        session.bodies[key] = recorded.number_of(found) if found or _has_mesh(armature, scene) else None
    return session.bodies[key]


def edited(meshes, keys: bool) -> None:
    """Something was edited: the shapes of these meshes, by name; with `keys`, perhaps those of any shape key."""
    session.bodies.clear()
    for name in list(session.surfaces) if keys else meshes:
        session.surfaces.pop(name, None)


def _has_mesh(armature, scene) -> bool:
    meshes = (thing for thing in scene.objects if thing.type == "MESH")
    return any(each.type == "ARMATURE" and each.object == armature for thing in meshes for each in thing.modifiers)


def _number_of(body) -> int:
    name = body.data.name_full
    if name not in session.surfaces:
        session.surfaces[name] = recorded.number_of(_surface(body))
    return session.surfaces[name]


def _surface(body) -> list:
    mesh, keys = body.data, body.data.shape_keys
    count, groups, weights = weighed_so(body)
    rigs = (each.object for each in body.modifiers if each.type == "ARMATURE")
    bones = {bone.name for rig in rigs if rig is not None for bone in rig.data.bones}
    # Groups of pins and masks move nothing, and their order says nothing.
    weighed = sorted(weight for group, weight in weights if group < len(groups) and groups[group] in bones)
    found = [count, len(mesh.polygons), weighed]
    if keys is None:
        return [*found, number_of(mesh)]
    played = [number_of_keys(curve) for curve in curves_of(keys.animation_data) if not is_muted(curve)]
    return [*found, number_of_shape(keys.reference_key), *_held(keys), *played]


def _held(keys) -> list:
    """The shape keys that count in all frames, because nothing animates them."""
    moving = animated(keys.animation_data)
    if not keys.use_relative:
        return [] if "eval_time" in moving else [keys.eval_time]
    others = [block for block in keys.key_blocks if block != keys.reference_key and block.value and not block.mute]
    held = [block for block in others if not moving & {block.path_from_id("value"), block.path_from_id("mute")}]
    return [(round(block.value, 6), number_of_shape(block)) for block in held]
