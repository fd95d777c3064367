# SPDX-License-Identifier: GPL-3.0-or-later
"""The body mesh at rest: surface, vertex groups and shape keys."""

import numpy as np

from ..services.rig import BodyArrays
from ..session import session
from .binding import carrying_bone

PROBES = 500
"""Vertices whose weights are compared with what is known."""


def find(armature, objects) -> list:
    """The visible meshes that this armature deforms, by name."""
    deformed = [o for o in objects if o.type == "MESH" and not o.hide_render and _deformed(o, armature)]
    return sorted(deformed, key=lambda o: o.name_full)


def read(mesh_object, armature) -> BodyArrays:
    """Vertices of the basis shape, triangles, weights and shape keys; a body that rides on one bone of the armature, as
    a whole, is weighted to it.
    """
    mesh = mesh_object.data
    points = _coordinates(mesh.vertices)
    mesh.calc_loop_triangles()
    triangles = np.empty((len(mesh.loop_triangles), 3), np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles.ravel())
    shapes = {}
    keys = mesh.shape_keys
    if keys and len(keys.key_blocks) > 1:
        basis = _coordinates(keys.reference_key.data)
        points = basis
        for block in keys.key_blocks:
            if block != keys.reference_key:
                shapes[block.name] = _coordinates(block.data) - _coordinates((block.relative_key or block).data)
    groups = tuple(group.name for group in mesh_object.vertex_groups)
    weights = _weights(mesh, groups)
    bone = None if _deformed(mesh_object, armature) else carrying_bone(mesh_object, armature)
    if bone is not None:
        groups, weights = (bone,), np.array([[i, 0, 1] for i in range(len(points))], float)
    return BodyArrays(mesh_object.name_full, points, triangles, groups, weights, shapes)


def _deformed(mesh_object, armature) -> bool:
    return any(m.type == "ARMATURE" and m.object == armature for m in mesh_object.modifiers)


def _weights(mesh, groups: tuple[str, ...]) -> np.ndarray:
    """Rows (N, 3) of vertex, group, weight: read again only when a few of them, or the groups, have changed.

    Blender gives them one by one: half a second for a large body.
    """
    some = range(0, len(mesh.vertices), max(1, len(mesh.vertices) // PROBES))
    probe = len(mesh.vertices), groups, tuple((g.group, g.weight) for v in some for g in mesh.vertices[v].groups)
    known = session.weights.get(mesh.name_full)
    if known is None or known[0] != probe:
        rows = [(v.index, g.group, g.weight) for v in mesh.vertices for g in v.groups]
        known = session.weights[mesh.name_full] = probe, np.array(rows, float).reshape(-1, 3)
    return known[1]


def shape_values(mesh_object) -> np.ndarray:
    """Values (B,) of the shape keys as they are now, in the order of `BodyArrays.shapes`."""
    keys = mesh_object.data.shape_keys
    if not keys or len(keys.key_blocks) < 2:
        return np.zeros(0)
    return np.array([0.0 if b.mute else b.value for b in keys.key_blocks if b != keys.reference_key])


def _coordinates(elements) -> np.ndarray:
    values = np.empty((len(elements), 3), np.float32)
    elements.foreach_get("co", values.ravel())
    return values.astype(float)
