# SPDX-License-Identifier: Apache-2.0
"""Notes on a character: whether its bind pose stands upright, whether its skin is bound whole, whether it has a body of a trained
size, and whether it is scaled evenly.
"""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdSkel

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.anatomy.standing import lies
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.measures import HIGHEST, LOWEST, MEASURES, body_measures, far_off
from neuralocks_core.rotation import transformed

from ...border.arrays import column_matrix
from ...border.values import as_numbers
from ...skel.binding import bound_skeleton, rest_primvar
from ...skel.stage_rig import StageRig
from ...skel.surface import drawn
from ..carriers.ways import beginnings
from ..characters.whole_body import parts_elsewhere
from .skeleton_notes import unlikely_head

AROUND = 0.25
"""A mesh with some points this near to a head's joint [m] is the head's, or on it."""
SOME = 20
UNEVEN = 1.02
"""Hair stretched this many times more along one axis than along another gets a note: its strands change their lengths."""
FLATTENED = 10
"""Larger ratios are not told exactly: for a nearly flat scale, it would be millions of percent."""


def lies_down(rig: StageRig) -> list[str]:
    """The note on a character that lies down in its bind pose, as one does whose up axis is not its stage's."""
    character = rig.character
    lying, sure = lies(character.skeleton.bind[:, :3, 3], character.humanoid, np.array([0.0, 1.0, 0.0]))
    foreign = rig.border.foreign(rig.joints.prim.GetAttribute("bindTransforms"), axis_only=True)
    unsaid = not rig.joints.prim.GetStage().HasAuthoredMetadata(UsdGeom.Tokens.upAxis)
    if not lying or not (sure or foreign or unsaid):
        return []
    up = rig.border.up_axis
    guess = f"the stage has no upAxis, so {up} is up: author it" if unsaid else f"if it stands, check upAxis ({up})"
    return [f"{rig.path}: lies down in its bind pose, so its hair is taken to hang sideways{foreign or f'; {guess}'}"]


def weight_notes(rig: StageRig) -> list[str]:
    """What is wrong with authored weights of a character's skin: reading makes them sum to one, and UsdSkel does not."""
    notes = []
    for mesh in rig.meshes:
        primvar = UsdSkel.BindingAPI(mesh.prim).GetJointWeightsPrimvar()
        values = np.asarray(rest_primvar(primvar) if primvar and primvar.HasValue() else [], float)
        size = max(int(primvar.GetElementSize()), 1) if len(values) else 1
        if len(values) % size or not len(values):
            continue
        path, total = mesh.prim.GetPath(), values.reshape(-1, size).sum(axis=1)
        free, off = total < 1e-9, np.abs(total - 1) > 0.01
        if free.any():
            first = leaf(rig.joints.names[mesh.indices[int(free.argmax()), 0]])
            notes.append(
                f"{path}: {int(free.sum())} of {len(free)} vertices have no weights and are read as bound to the "
                f"first joint that they name, such as '{first}'; bind them in the rig"
            )
        if (off & ~free).any():
            notes.append(
                f"{path}: weights of {int((off & ~free).sum())} of {len(off)} vertices do not sum to one and are read as if they "
                "did, but UsdSkel shows these vertices elsewhere; normalise them in the rig"
            )
    return notes


def untrained(rig: StageRig) -> list[str]:
    """The note on a character that carries hair and has a size that no network was trained on."""
    if unlikely_head(rig):
        return []  # told already
    measures = body_measures(rig.character, rig.clip.shape[0])
    far = far_off(measures, LOWEST, HIGHEST)
    if not far:
        return []
    each = [f"its {MEASURES[i]} is {measures[i]:.3g} m (trained: {LOWEST[i]:g} to {HIGHEST[i]:g})" for i in far]
    return [
        f"{rig.path}: {', '.join(each)}; a model that was not trained on this character, such as the shipped one, moves its hair as if "
        "that were the nearest trained size; if it shows, train one on it; if a hat or the like is part of its skin mesh, split it off"
    ]


def unevenly_scaled(rig: StageRig) -> list[str]:
    """The note on what carries hair and stretches it more along one axis than along another in any frame.

    Scale of the whole character is in its bind pose, too, so hair is only stretched as far as its head turns within it.
    """
    ratio = _unevenness(rig.character.carrying(rig.clip.joints))
    frame = int(ratio.round(4).argmax())  # the first of those that are equal
    if ratio[frame] < UNEVEN:
        return []
    code = rig.time_codes[frame]
    placed, joint = rig.joints.placement, leaf(rig.joints.names[rig.character.carrying_joint])
    what = placed.whose(uneven, code) if uneven(placed.at(code)) else f"joint '{joint}'"
    much = f"by {ratio[frame] - 1:.0%} more along one axis than"
    if ratio[frame] >= FLATTENED:
        much = f"over {FLATTENED} times as much along one axis as"
    return [
        f"{rig.path}: {what} is scaled unevenly and stretches its hair, at time code {code:g} {much} "
        "along another: strands keep their lengths before that scale, not in the world; scale it evenly if that shows"
    ]


def uneven(transform: np.ndarray, least: float = UNEVEN) -> bool:
    """Whether a transform (4, 4) scales at least this many times more along one axis than along another."""
    sizes = np.linalg.svd(transform[:3, :3], compute_uv=False)
    return bool(sizes[0] >= least * sizes[2])


def _unevenness(transforms: np.ndarray) -> np.ndarray:
    """The largest scale of transforms (..., 4, 4) over the smallest; 1 if that is zero, which is reported elsewhere."""
    sizes = np.linalg.svd(transforms[..., :3, :3], compute_uv=False)
    largest, smallest = sizes[..., 0], sizes[..., 2]
    return np.divide(largest, smallest, out=np.ones_like(largest), where=smallest > 1e-9)


def without_body(rigs: Sequence[StageRig], others: Sequence[StageRig]) -> list[str]:
    """The notes on characters without a mesh that hair could be kept out of, and on the meshes that may be meant.

    Args:
        rigs: skeletons that carry hair.
        others: all skeletons of the stage; a character in several skeletons has its own note elsewhere.
    """
    bare = [rig for rig in rigs if rig.character.body is None and not any(parts_elsewhere(rig, others))]
    if not bare:
        return []
    hidden, loose = _unused_meshes(bare[0].joints.prim.GetStage())
    return [
        f"{rig.path}: moves no visible mesh, so hair is kept out of no body and moves as on an average head; "
        f"{_meant(hidden.get(rig.path, []), loose, rig) or 'bind its mesh to it'}"
        for rig in bare
    ]


def _unused_meshes(stage: Usd.Stage) -> tuple[dict[str, list[Usd.Prim]], list[Usd.Prim]]:
    """Hidden meshes that a skeleton moves, by its path, and visible ones that no skeleton moves."""
    hidden, loose = {}, []
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        if prim.IsA(UsdGeom.Mesh):
            seen, skeleton = drawn(prim), bound_skeleton(prim)
            if seen and skeleton is None:
                loose.append(prim)
            elif not seen and skeleton is not None:
                hidden.setdefault(skeleton, []).append(prim)
    return hidden, loose


def _meant(hidden: list[Usd.Prim], loose: list[Usd.Prim], rig: StageRig) -> str:
    """Which meshes may be its body, and what to do; '' if none is found."""
    if hidden:
        return f"{_named(hidden)}, bound to it, {_is(hidden)} not drawn: show the body"
    when = beginnings(rig)[-1]
    head = transformed(rig.joints_at(when)[rig.character.head, :3, 3], rig.border.from_core)
    near = AROUND / rig.border.metres_per_unit
    around = []
    boxes = UsdGeom.BBoxCache(when, [UsdGeom.Tokens.default_, UsdGeom.Tokens.render])
    places = UsdGeom.XformCache(when)
    for prim in loose:
        box = boxes.ComputeWorldBound(prim).ComputeAlignedRange()
        if not box.IsEmpty() and box.GetDistanceSquared(Gf.Vec3d(*head)) < near**2:
            attribute = UsdGeom.Mesh(prim).GetPointsAttr()
            # A mesh that nothing else reads may be broken.
            with suppress(NeuralocksError), np.errstate(invalid="ignore", over="ignore"):
                points = as_numbers(attribute, "point3f[]", attribute.Get(when))
                world = transformed(points, column_matrix(places.GetLocalToWorldTransform(prim)))
                if np.sum(np.linalg.norm(world - head, axis=1) < near) >= SOME:
                    around.append(prim)
    if not around:
        return ""
    return f"{_named(around)}, around its head, {_is(around)} not bound to it: export the body with its weights"


def _named(prims: list[Usd.Prim]) -> str:
    return ", ".join(str(prim.GetPath()) for prim in prims[:3])


def _is(prims: list[Usd.Prim]) -> str:
    return "is" if len(prims) == 1 else "are"
