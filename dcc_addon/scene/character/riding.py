# SPDX-License-Identifier: GPL-3.0-or-later
"""What hair objects ride on: the head, a joint below it such as a beard's jaw, or neither, if the object has its own keys. The
latter is reported, since live hair and bakes stay on the head whatever such an object does; so is a hair bone that is live or keyed.
"""

from collections.abc import Callable

import numpy as np

from neuralocks_core.anatomy.hierarchy import ancestors, below

from ...services.rigs import following
from ...services.rigs import rig as rig_service
from ..hair import curves
from ..keys.hair_keys import as_before
from .binding import carrying_bone

FAR = 0.01
"""Smaller distances are not reported [m]."""
PROBES = 1000
"""About how many points' mean stands for a whole hair object."""


def carriers(
    rig: rig_service.RigArrays, head: int, heads: np.ndarray, moved: Callable[[int], np.ndarray], places: dict
) -> dict[str, int]:
    """The joints below the head that hair objects ride on, by name; the others ride on the head.

    Args:
        rig: the armature.
        head, heads: its joint that carries hair, and the joint's world transforms (T, 4, 4).
        moved: gives those of a joint, as Blender has them.
        places: those of the hair objects, by name.
    """
    named = rig.named_head()  # if the artist calls the neck the head, the head is not a part of it
    able = [joint for joint in below(head, rig.parents) if joint not in (head, named)]
    found = {name: following.carrier_below(place, heads, able, moved) for name, place in places.items()}
    return {name: joint for name, joint in found.items() if joint is not None}


def strays_told(
    hairs: list,
    rig: rig_service.RigArrays,
    heads: np.ndarray,
    moved: Callable[[int], np.ndarray],
    places: dict,
    metres: float,
) -> dict[str, str]:
    """Notes on hair objects that do not move with the head, by name.

    Args:
        hairs: those that ride on no joint below it.
        rig, heads, moved: as for `carriers`.
        places: world transforms (T, 4, 4) of the hair objects, by name, and of the armature under "".
        metres: of Blender's unit.
    """
    carrying = ancestors(rig.humanoid.get("hips", 0), rig.parents)  # what carries the whole body counts like its object
    ways = [np.broadcast_to(np.eye(4), heads.shape), places[""], heads, *map(moved, carrying)]
    said = {hair.name_full: _told(hair, places[hair.name_full], ways, metres) for hair in hairs}
    return {name: text for name, text in said.items() if text}


def on_hair_bone(hair) -> str:
    """Why strands cannot be shown, or played from a cache, on a hair bone that is live or has baked keys: Blender moves their object with
    it, and they are sampled without that motion. Empty if their object is not on one.
    """
    armature = hair.neuralocks_hair.armature
    bone = armature.data.bones.get(carrying_bone(hair, armature) or "") if armature is not None else None
    turned = as_before(armature, playing=True) if bone is not None else {}
    found = next((each.name for each in (bone, *bone.parent_recursive) if each.name in turned), "") if turned else ""
    if not found:
        return ""
    return (
        f"{hair.name_full}: its object moves with hair bone '{found}', which is live or has baked keys, and strands do not follow the "
        "motion of hair bones; make it a child of the head bone"
    )


def _told(hair, places: np.ndarray, ways: list[np.ndarray], metres: float) -> str:
    """The note on a hair object at `places`, empty if it moves with one of the things that hair may be attached to, the head's
    `ways`.
    """
    points, shown = curves.points(hair.data), np.abs(np.linalg.det(places)) > 0
    if not len(points) or not shown.any() or hair.parent_type.startswith("VERTEX"):  # skin is followed strand by strand
        return ""
    middle = points[:: max(1, len(points) // PROBES)].mean(axis=0, dtype=float)
    path = places[shown, :3, :3] @ middle + places[shown, :3, 3]
    far = metres * following.strays(path, [way[shown] for way in ways])
    if not far >= FAR:
        return ""
    bone = hair.parent_bone if hair.parent_type == "BONE" else ""
    remedy = f"if {bone} is the head, choose it as Head Bone; otherwise " if bone else ""
    return (
        f"{hair.name_full}: its object moves up to {1000 * far:.0f} mm relative to the head, which live hair and bakes do "
        f"not follow: they stay on the head bone; {remedy}make it a child of the bone that it should follow"
    )
