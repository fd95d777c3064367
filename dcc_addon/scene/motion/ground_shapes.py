# SPDX-License-Identifier: GPL-3.0-or-later
"""The shape of what a rig stands on, rides on or runs along, except what animation writes: a ground, a saddle, a path."""

from ...session import session
from ..character.body import number_of, number_of_shape
from ..objects.animated import animated, targets_of
from ..objects.settings import as_set, settings_of

CURVE = (
    "dimensions",
    "resolution_u",
    "twist_mode",
    "twist_smooth",
    "use_path",
    "use_path_clamp",
    "path_duration",
    "eval_time",
)
POINT = ("co", "handle_left", "handle_right", "tilt", "radius")
"""What an object that moves along a curve reads from its points."""


def shape(thing) -> list:
    """Numbers that change when the points, or the shape keys, of a curve, a mesh or a lattice are edited; none for other objects."""
    if thing.type == "CURVE":
        return _curve(thing.data)
    if thing.type == "MESH":
        return [number_of(thing.data), *_keys(thing.data.shape_keys)]
    if thing.type == "LATTICE":
        return [[point.co_deform[:] for point in thing.data.points], *_keys(thing.data.shape_keys)]
    return []


def follows(mesh, others) -> bool:
    """Whether a body mesh only takes another shape with these data blocks, which drivers of its shape keys read; an edit of it may change
    some of them, too.
    """
    data = mesh.shape_keys.animation_data if mesh.shape_keys else None
    read = {target.id for _, target in targets_of(data) if target.id in others} if data else set()
    if all(each in (mesh, mesh.shape_keys) or getattr(each, "data", None) == mesh for each in read):
        return False
    return session.read.vertices.get(mesh.name_full) == number_of(mesh)


def _curve(curve) -> list:
    moving = animated(curve.animation_data)
    found = as_set(curve, [name for name in CURVE if name not in moving])
    if not any(path.startswith("splines") for path in moving):
        for spline in curve.splines:
            found += as_set(spline, settings_of(spline))
            for point in (*spline.points, *spline.bezier_points):
                values = (getattr(point, name) for name in POINT if hasattr(point, name))
                found.append([tuple(value) if hasattr(value, "__len__") else value for value in values])
    return found


def _keys(keys) -> list:
    moving, found = animated(keys.animation_data) if keys else (), []
    for block in keys.key_blocks if keys else ():
        value = 0.0 if block.path_from_id("value") in moving else block.value
        found += [block.name, block.mute, value, number_of_shape(block)]
    return found
