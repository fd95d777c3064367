# SPDX-License-Identifier: GPL-3.0-or-later
"""A character of the scene as a USD shot, from the same numbers that the live view reads."""

from pathlib import Path

import numpy as np

from neuralocks_core.rotation import relative_to_parents

from ..services.rigs import names
from ..services.rigs.axes import to_core
from ..services.rigs.rig import joint_weights, shape_names, skin
from ..services.work.threaded import Threaded
from .files.paths import beside
from .hair import curves

BASES = {"CATMULL_ROM": "catmullRom", "NURBS": "bspline"}
"""The USD basis of each strand type that is not straight lines."""


def write_shot(path: Path, armature, sampled, hairs, undrawn=(), share: float = 0.0, played: bool = False):
    """Steps (done, total, message) of writing the armature's motion, its body and hair at rest. What is in Blender is read before the
    first of them; a thread writes it, because a long shot takes seconds.

    Args:
        path: the USD file.
        armature: the character to write.
        sampled: its `SampledRig`.
        hairs: hair objects to write, carried by the armature.
        undrawn: names of those that are invisible in the file.
        share: of longer work that is done before.
        played: whether this Blender file plays the bake over the shot.

    Returns:
        prim path of each object that was written, by name.

    Raises:
        NeuralocksError: the file cannot be written, or the USD libraries are missing.
    """
    from usd.assets.scene_writer import RIG, SceneArrays, prim_path, write_scene

    motion, rig = sampled.motion, sampled.rig
    bind = np.linalg.inv(to_core(sampled.bind_metres)) @ sampled.character.skeleton.bind
    labels, skins = names.unique([f"Hair_{h.name}" for h in hairs]), _skins(sampled)

    arrays = SceneArrays(
        metres_per_unit=motion.metres_per_unit,
        rate=motion.rate,
        frames=motion.frames,
        joints=rig.paths,
        bind=bind,
        rest=relative_to_parents(bind, rig.parents),
        translation=motion.translation,
        rotation=motion.rotation,
        scale=motion.scale,
        skins=list(skins.values()),
        shape=motion.shape,
        hair=[
            _hair(hair, label, sampled, hair.name_full not in undrawn, played)
            for hair, label in zip(hairs, labels, strict=True)
        ],
        name=armature.name_full,
        player=beside(path) if played else "",
    )
    prims = {hair.name_full: prim_path(label) for hair, label in zip(hairs, labels, strict=True)}
    prims |= {body: prim_path(skinned.name) for body, skinned in skins.items()}
    prims[armature.name_full] = RIG
    yield from Threaded(lambda _: write_scene(path, arrays), "Writing the shot").steps(share, share)
    return prims


def _hair(hair, label: str, sampled, visible: bool, played: bool):
    """A hair object at rest, as `HairArrays`."""
    from usd.assets.prims import Spline
    from usd.assets.scene_writer import HairArrays

    data, radius = hair.data, curves.radius(hair.data)
    if radius is None or not len(radius):
        radius = np.full(1, curves.RADIUS)
    basis = BASES.get(curves.kind(data))
    return HairArrays(
        name=label,
        points=curves.points(data),
        counts=curves.counts(data),
        widths=2 * radius,
        bind_place=sampled.bind_places[hair.name_full],
        places=sampled.motion.places[hair.name_full],
        joint=sampled.carrying(hair.name_full).carrying_joint,
        spline=Spline("cubic", basis, "pinned") if basis else Spline(),
        visible=visible,
        keeps_widths=played and curves.one_radius_a_strand(data),
    )


def _skins(sampled) -> dict:
    """The bodies that were sampled, as `SkinArrays` by object name; shape names are unique among all of them."""
    from usd.assets.scene_writer import SkinArrays

    arrays = sampled.body_arrays
    labels, shape_labels = names.unique([f"Body_{a.name}" for a in arrays]), iter(shape_names(arrays))
    skins = {}
    for body, label in zip(arrays, labels, strict=True):
        points, triangles, shapes = skin(body, sampled.bind_places[body.name])
        shapes = {next(shape_labels): offsets for offsets in shapes.values()}
        weights = joint_weights(body, sampled.rig.bones)
        skins[body.name] = SkinArrays(label, points, triangles, *weights, shapes)
    return skins
