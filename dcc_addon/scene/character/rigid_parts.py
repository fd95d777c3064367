# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes under the hair that a bone carries as a whole: a head that is a separate object, or a face with a rig of its own that follows
the head. Only what an armature deforms is its body.
"""

import numpy as np

from neuralocks_core.rotation import flat, inverse, transformed

from ..drawing.visibility import in_renders
from ..hair import curves
from .binding import carrying_bone, deforming, followers
from .body import followed_bone, vertices

MARGIN = 0.05
"""How far roots may lie outside of a mesh's box, in sizes of the box."""
UNDER = 0.5
"""Share of the roots that lie in the box of a mesh that hair grows on."""


def find(armature, bodies: list, scene) -> list:
    """Rendered meshes with faces that a bone of an armature carries as a whole, and that are not among its `bodies`."""
    meshes = [o for o in scene.objects if o.type == "MESH" and len(o.data.polygons) and o not in bodies]
    rigs = {other for o in meshes for other in deforming(o)}  # each is looked at once: a crowd has hundreds
    joined = {other for other in rigs if followers(other, armature)}
    return [
        o
        for o in meshes
        if (carrying_bone(o, armature) or joined.intersection(deforming(o)) and followed_bone(o, armature))
        and in_renders(o, scene)
    ]


def told(armature, parts: list, hairs: list, places: dict) -> tuple[str, ...]:
    """Notes on `parts` that hair of an armature grows on; `places` has the world transforms (4, 4) of all in the rest pose."""
    roots = np.concatenate([np.zeros((0, 3)), *(_roots(hair.data, places[hair.name_full]) for hair in hairs)])
    found = sorted((o for o in parts if _under(o.data, places[o.name_full], roots)), key=lambda o: o.name_full)
    return tuple(_told(o, armature) for o in found)


def _told(part, armature) -> str:
    bone, remedy = carrying_bone(part, armature), "choose it as Body"
    if bone is not None:
        how = f"it rides on the bone '{bone}' as a whole"
        remedy += (
            f", or take it off the bone with the rig at rest, parent it to {armature.name_full} with Armature Deform, and give that "
            "bone's vertex group all its vertices"
        )
    else:
        how = f"{deforming(part)[0].name_full}, which follows the bone '{followed_bone(part, armature)}', deforms it"
        remedy += ", in place of any other, or join a copy of it to the body"
    return f"{part.name_full}: {how}, so it is not part of the body, and hair is not kept out of it; if it should be, {remedy}"


def _roots(data, place: np.ndarray) -> np.ndarray:
    """World positions (S, 3) of the roots."""
    counts = curves.counts(data)
    return transformed(curves.points(data)[np.cumsum(counts) - counts], place)


def _under(mesh, place: np.ndarray, roots: np.ndarray) -> bool:
    """Whether most roots lie in the box of a mesh."""
    if flat(place[:3, :3]) or not len(roots):
        return False
    points, own = vertices(mesh), transformed(roots, inverse(place))
    low, high = points.min(axis=0), points.max(axis=0)
    margin = MARGIN * np.linalg.norm(high - low)
    return ((own >= low - margin) & (own <= high + margin)).all(axis=1).mean() >= UNDER
