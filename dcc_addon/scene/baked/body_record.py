# SPDX-License-Identifier: GPL-3.0-or-later
"""The bodies that hair is kept out of, as numbers of a record; see `records`. The panel asks in every redraw, and looking for them in
a large scene, or reading a large one, takes longer than that may take: both are done again only after an edit that may change them.
"""

import bpy

from ...session import session
from ..character.binding import deforming
from ..character.body import number_of, number_of_shape, weighed_so
from ..character.carried import bodies_of
from ..motion.ground_shapes import follows
from ..motion.rigging import number_of_keys
from ..objects import records
from ..objects.animated import animated, curves_of, is_muted
from ..objects.lookup import identity
from .shape_drivers import number_of_drivers

SHAPED = bpy.types.Mesh, bpy.types.Key
_KINDS = "Armature", "Camera", "Curve", "Curves", "Image", "Light", "Material", "NodeTree", "Texture", "World"
APART = (*SHAPED, *(getattr(bpy.types, kind) for kind in _KINDS))
"""Data blocks that make no mesh a body by being edited, or are looked at one by one. An armature counts as edited whenever it is posed."""


def numbers_of_bodies(armature, scene) -> tuple[int | None, int | None]:
    """Two numbers: one that changes when the bodies of an armature become others, or one takes another shape, other weights or other keys
    of its shape keys, and one that changes when drivers of these do. Names count for nothing. None if the scene has no mesh on the
    armature at all, as where hair alone was appended: nobody changed a body then.
    """
    chosen, data = armature.neuralocks_character.body, [keys.animation_data for keys in bpy.data.shape_keys]
    # Blender does not tell of objects of a scene that is not in view, nor do older ones of a driver that is removed.
    counts = len(scene.objects), sum(len(each.drivers) for each in data if each is not None)
    key = identity(armature), identity(scene), chosen and identity(chosen), counts
    if key not in session.read.bodies:
        bodies = bodies_of(armature, scene)
        shapes, driven = sorted(map(_number_of, bodies)), [number_of_drivers(body.data) for body in bodies]
        known = bodies or any(armature in deforming(thing) for thing in scene.objects if thing.type == "MESH")
        numbers = records.number_of(shapes), records.number_of(sorted(filter(None, driven)))
        session.read.bodies[key] = numbers if known else (None, None)
    return session.read.bodies[key]


def updated(updates) -> None:
    """Look again at what an update of Blender's may have changed; `updates` are those of a depsgraph."""
    if not (session.read.bodies or session.read.surfaces):
        return
    ids, others = [update.id for update in updates], any(map(_regroups, updates))
    shaped = [thing.original for thing in ids if isinstance(thing, SHAPED)]
    meshes = {thing if isinstance(thing, bpy.types.Mesh) else thing.user for thing in shaped}
    known = set() if others else {mesh for mesh in meshes if mesh.name_full in session.read.surfaces}
    own = [thing.original for thing in ids] if known else []
    # One that takes only the shape of another pose, by drivers, is known still.
    edited = {mesh for mesh in meshes if mesh not in known or not follows(mesh, own)}
    if others or edited:
        session.read.bodies.clear()
    replayed = _replayed({thing.original for thing in ids if isinstance(thing, bpy.types.Action)}) if others else set()
    for name in replayed.union(mesh.name_full for mesh in edited):
        session.read.surfaces.pop(name, None)


def _regroups(update) -> bool:
    """Whether an update may make other meshes bodies, or play other keys. Blender tells of every change of dependencies, and of what is
    drawn, as one of a scene, too. A mesh that is merely moved or deformed is updated in no other way.
    """
    thing = update.id
    if isinstance(thing, bpy.types.Object):
        moved = update.is_updated_transform or update.is_updated_geometry
        return thing.type == "MESH" and (update.is_updated_shading or not moved)
    return not isinstance(thing, APART)


def _number_of(body) -> int:
    """Of its surface, known as long as the same shape keys are animated: older Blenders do not tell of a driver that is removed."""
    mesh = body.data
    moving, known = (
        animated(mesh.shape_keys and mesh.shape_keys.animation_data),
        session.read.surfaces.get(mesh.name_full),
    )
    if known is None or known[0] != moving:
        known = session.read.surfaces[mesh.name_full] = moving, records.number_of(_surface(body))
    return known[1]


def _replayed(actions: set) -> set[str]:
    """Names of the meshes whose shape keys may play one of these actions, by themselves or in a strip."""
    played = ((keys.user.name_full, keys.animation_data) for keys in bpy.data.shape_keys if actions)
    return {name for name, data in played if data is not None and (data.action in actions or data.nla_tracks)}


def _surface(body) -> list:
    mesh, keys = body.data, body.data.shape_keys
    count, groups, weights = weighed_so(body)
    bones = {bone.name for rig in deforming(body) for bone in rig.data.bones}
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
