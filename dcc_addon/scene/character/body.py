# SPDX-License-Identifier: GPL-3.0-or-later
"""The body mesh at rest: surface, vertex groups and shape keys."""

import zlib
from collections.abc import Iterator
from dataclasses import replace

import bpy
import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import inverse

from ...services.rigs.mirror import mirrored
from ...services.rigs.rig import BodyArrays
from ...session import session
from ..drawing.visibility import in_renders
from .armature import matrix
from .binding import carrier, carrying_bone, deforming, followers
from .skinned import deformed, moving_groups

PROBES = 500
"""Vertices whose weights are compared with the stored ones."""
WEIGHED = 4000
"""Vertices whose weights are read in one step."""


def find(armature, scene) -> list:
    """The meshes that this armature deforms and that a render of the scene draws in any frame, by name; without those whose faces
    only come from modifiers.
    """
    meshes = [o for o in scene.objects if o.type == "MESH" and deformed(o, armature)]  # of thousands of objects, a few
    return sorted((o for o in meshes if len(o.data.polygons) and in_renders(o, scene)), key=lambda o: o.name_full)


def read(mesh_object, armature) -> BodyArrays:
    """Vertices of the basis shape, triangles, weights and shape keys, with what mirror modifiers add; a body that rides on one bone
    of the armature as a whole is weighted to it.

    Raises:
        NeuralocksError: it has no faces.
    """
    mesh = mesh_object.data
    if not len(mesh.polygons):
        raise NeuralocksError(
            f"{mesh_object.name_full}: it has no faces to keep hair out of; choose a body with a surface, or none"
        )
    points = vertices(mesh).astype(float)
    session.read.vertices[mesh.name_full] = number_of(mesh)
    triangles = _triangles(mesh)
    for _ in weighed(mesh_object):
        pass
    (_, groups, _), weights = session.read.weights[mesh.name_full]
    shapes, keys = {}, mesh.shape_keys
    if keys and len(keys.key_blocks) > 1:
        basis = coordinates(keys.reference_key)
        points = basis.astype(float)
        for block in keys.key_blocks:
            if block != keys.reference_key:
                if keys.use_relative:
                    offsets = np.subtract(coordinates(block), coordinates(block.relative_key or block), dtype=float)
                    shapes[block.name] = offsets * _mask(block, groups, weights, len(points))
                else:  # Blender blends the keys as they are, without their groups
                    shapes[block.name] = np.subtract(coordinates(block), basis, dtype=float)
    body = BodyArrays(mesh_object.name_full, points, triangles, groups, weights, shapes)
    for modifier in up_to_armature(mesh_object):
        if modifier.type == "MIRROR" and modifier.show_render:
            body = _mirrored(body, mesh_object, modifier)
    if deformed(mesh_object, armature):
        return replace(body, groups=moving_groups(mesh_object, armature))
    if (bone := _rigid_on(mesh_object, armature)) is not None:
        rigid = np.array([[i, 0, 1] for i in range(len(body.points))], float)
        return replace(body, groups=(bone,), weights=rigid)
    return body


def followed_bone(mesh_object, armature) -> str | None:
    """The bone of an armature that everything follows which deforms a mesh of another rig, as a face's head joint; None if that is not
    one bone.
    """
    for other in deforming(mesh_object):
        known = followers(other, armature)
        moving = [other.data.bones[name] for name in moving_groups(mesh_object, other) if name] if known else []
        ways = [[each.name for each in (bone, *bone.parent_recursive) if each.name in known] for bone in moving]
        found = {known[way[0]] if way else None for way in ways}
        if len(found) == 1 and None not in found:
            return found.pop()
    return None


def _rigid_on(mesh_object, armature) -> str | None:
    """The bone that carries a mesh as a whole; of another rig's mesh, only if none of its groups are this one's."""
    bone = carrying_bone(mesh_object, armature)
    return bone if bone or any(moving_groups(mesh_object, armature)) else followed_bone(mesh_object, armature)


def left_behind(mesh_object, armature) -> str:
    """The note on a body that no bone of this armature moves, since it stays with the first bone; empty if one does."""
    if any(moving_groups(mesh_object, armature)) or _rigid_on(mesh_object, armature) is not None:
        return ""
    moving = carrier(mesh_object, None)
    remedy = f"choose {moving.name_full} as the character" if moving not in (None, armature) else "choose another body"
    return (
        f"{mesh_object.name_full}: none of its vertex groups belongs to a deforming bone of {armature.name_full}, so hair is not "
        f"kept out of it as it moves; {remedy}"
    )


def up_to_armature(mesh_object) -> list:
    """Modifiers whose result an armature deforms, and that of the armature; all, if no armature does."""
    types = [modifier.type for modifier in mesh_object.modifiers]
    return list(mesh_object.modifiers)[: types.index("ARMATURE") + 1 if "ARMATURE" in types else None]


def _mask(block, groups: tuple[str, ...], weights: np.ndarray, count: int):
    """How much of a shape key each vertex takes, (V, 1); all take all of it if no vertex group limits it."""
    if block.vertex_group not in groups:
        return 1.0
    mask = np.zeros((count, 1))
    members = weights[weights[:, 1] == groups.index(block.vertex_group)]
    mask[members[:, 0].astype(int), 0] = members[:, 2]
    return mask


def _mirrored(body: BodyArrays, mesh_object, modifier) -> BodyArrays:
    way = back = np.eye(4)
    if (middle := modifier.mirror_object) is not None:
        there, here = matrix(middle.matrix_world), matrix(mesh_object.matrix_world)
        try:
            way, back = inverse(there) @ here, inverse(here) @ there
        except NeuralocksError:
            raise NeuralocksError(
                f"{mesh_object.name_full}: its modifier '{modifier.name}' mirrors it in '{middle.name_full}', and one of both has "
                "zero scale; give it a scale above zero"
            ) from None
    partner = np.arange(len(body.groups))
    if modifier.use_mirror_vertex_groups:
        flipped = [bpy.utils.flip_name(name) for name in body.groups]
        partner = np.array([body.groups.index(f) if f in body.groups else i for i, f in enumerate(flipped)], int)
    for axis in np.flatnonzero(modifier.use_axis[:]):
        across = np.eye(4)
        across[axis, axis] = -1
        merge = modifier.merge_threshold if modifier.use_mirror_merge else -1.0
        body = mirrored(body, back @ across @ way, partner, merge)
    return body


def weighed(mesh_object) -> Iterator[None]:
    """Put the weights of a body into the session, as rows (N, 3) of vertex, group, weight, unless those there are `weighed_so`; a few
    thousand vertices in each step: Blender gives them one by one, which takes half a second for a large body. Scripts can leave
    weights of groups that do not exist, which Blender passes over.
    """
    mesh, probe = mesh_object.data, weighed_so(mesh_object)
    name, edits, groups, rows = mesh.name_full, session.edits, len(mesh_object.vertex_groups), []
    if name in session.read.weights and session.read.weights[name][0] == probe:
        return
    for first in range(0, len(mesh.vertices), WEIGHED):
        some = mesh.vertices[first : first + WEIGHED]
        rows += [(v.index, g.group, g.weight) for v in some for g in v.groups if g.group < groups]
        yield
    if edits == session.edits:  # otherwise they were edited in between and are read again
        session.read.weights[name] = probe, np.array(rows, float).reshape(-1, 3)


def weighed_so(mesh_object) -> tuple:
    """What changes when the weights of a body do: how many vertices it has, the names of its groups, and the weights of some vertices."""
    mesh, groups = mesh_object.data, tuple(group.name for group in mesh_object.vertex_groups)
    some = range(0, len(mesh.vertices), max(1, len(mesh.vertices) // PROBES))
    return len(mesh.vertices), groups, tuple((g.group, g.weight) for v in some for g in mesh.vertices[v].groups)


def shape_values(mesh_object, graph) -> np.ndarray:
    """Values (B,) of the shape keys as `graph` has them, in the order of `BodyArrays.shapes`; those in the file follow only the
    view layer that is shown. Absolute keys are blended from the two nearest in time, as with linear interpolation.
    """
    keys = mesh_object.data.shape_keys
    if not keys or len(keys.key_blocks) < 2:
        return np.zeros(0)
    keys = keys.evaluated_get(graph)
    if not keys.use_relative:
        blocks = sorted(keys.key_blocks, key=lambda block: block.frame)
        frames, each = [block.frame for block in blocks], np.eye(len(blocks))
        shares = {b.name: np.interp(keys.eval_time, frames, each[row]) for row, b in enumerate(blocks)}
        return np.array([shares[b.name] for b in keys.key_blocks if b != keys.reference_key])
    return np.array([0.0 if b.mute else b.value for b in keys.key_blocks if b != keys.reference_key])


def _triangles(mesh) -> np.ndarray:
    """Corners (F, 3) int32 of the faces, cut into triangles."""
    mesh.calc_loop_triangles()
    triangles = np.empty((len(mesh.loop_triangles), 3), np.int32)
    kept = mesh.attributes.get(".corner_vert")
    if kept is None:  # before Blender 4.0
        mesh.loop_triangles.foreach_get("vertices", triangles.ravel())
        return triangles
    vertex_of = np.empty(len(mesh.loops), np.int32)
    kept.data.foreach_get("value", vertex_of)
    mesh.loop_triangles.foreach_get("loops", triangles.ravel())
    return vertex_of[triangles]


def number_of(mesh) -> int:
    """A number that changes when vertices of a mesh do."""
    return zlib.crc32(vertices(mesh))


def vertices(mesh) -> np.ndarray:
    """Points (V, 3) float32 of a mesh in its own space."""
    points, kept = np.empty((len(mesh.vertices), 3), np.float32), mesh.attributes.get("position")
    if kept is None:  # before Blender 3.5
        mesh.vertices.foreach_get("co", points.ravel())
    else:  # as a block, a hundred times faster
        kept.data.foreach_get("vector", points.ravel())
    return points


def number_of_shape(block) -> int:
    """A number that changes when the points of a shape key do."""
    return zlib.crc32(coordinates(block))


def coordinates(block) -> np.ndarray:
    """Points (V, 3) float32 of a shape key of a mesh or a lattice."""
    elements = getattr(block, "points", block.data)  # as a block, fifty times faster; not before Blender 4.1
    values = np.empty((len(elements), 3), np.float32)
    elements.foreach_get("co", values.ravel())
    return values
