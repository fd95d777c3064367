# SPDX-License-Identifier: GPL-3.0-or-later
"""A character of the scene as a USD shot, from the very numbers that the live view reads."""

from pathlib import Path

import numpy as np

from ..services import names
from ..services.axes import to_core
from ..services.rig import joint_weights, shape_names, skin
from . import body as body_reader
from . import curves
from .sampling import bodies_of, hairs_of

BASES = {"CATMULL_ROM": "catmullRom", "NURBS": "bspline"}
"""What strands of a type are in USD, where they are more than straight lines."""


def write_shot(path: str, armature, scene, sampled, hairs=None) -> dict[str, str]:
    """Write the armature's motion, its body and its hair at rest.

    Args:
        path: the USD file.
        armature, scene: what to write.
        sampled: its `SampledRig`.
        hairs: hair objects to write; all that the armature carries if left out.

    Returns:
        prim path of each hair object, by name.

    Raises:
        NeuralocksError: the file cannot be written, or the USD libraries are missing.
    """
    from usd.groom import Spline
    from usd.scene_writer import HairArrays, SceneArrays, SkinArrays, hair_path, write_scene

    splines = {kind: Spline("cubic", basis, "pinned") for kind, basis in BASES.items()}
    motion, rig = sampled.motion, sampled.rig
    from_core = np.linalg.inv(to_core(sampled.bind_metres))
    bind = from_core @ sampled.character.skeleton.bind
    hairs = hairs_of(armature, scene) if hairs is None else hairs
    labels = names.unique([f"Hair_{h.name}" for h in hairs])
    prims = []
    for hair, label in zip(hairs, labels, strict=True):
        data, radius = hair.data, curves.radius(hair.data)
        if radius is None or not len(radius):
            radius = np.full(1, curves.RADIUS)
        prims.append(
            HairArrays(
                label,
                curves.points(data),
                curves.counts(data),
                2 * radius,
                sampled.bind_places[hair.name_full],
                motion.places[hair.name_full],
                sampled.character.head,
                splines.get(curves.kind(data), Spline()),
            )
        )
    bodies = [
        body_reader.read(body, armature) for body in bodies_of(armature, scene) if body.name_full in motion.places
    ]
    labels_of_shapes = iter(shape_names(bodies))
    skins = []
    for arrays, label in zip(bodies, names.unique([f"Body_{b.name}" for b in bodies]), strict=True):
        points, triangles, shapes = skin(arrays, sampled.bind_places[arrays.name])
        shapes = {next(labels_of_shapes): offsets for offsets in shapes.values()}
        skins.append(SkinArrays(label, points, triangles, *joint_weights(arrays, rig.bones), shapes))
    rest = bind.copy()
    for joint, parent in enumerate(rig.parents):
        if parent >= 0:
            rest[joint] = np.linalg.inv(bind[parent]) @ bind[joint]
    write_scene(
        Path(path),
        SceneArrays(
            motion.metres_per_unit,
            motion.rate,
            motion.frames,
            rig.paths,
            bind,
            rest,
            motion.translation,
            motion.rotation,
            motion.scale,
            skins,
            motion.shape,
            prims,
        ),
    )
    return {hair.name_full: hair_path(label) for hair, label in zip(hairs, labels, strict=True)}
