# SPDX-License-Identifier: Apache-2.0
"""What an engine needs from a shot's grooms besides the graphs: all data of each strand that is the same in every frame.

Locks, scalp frames, resampling and body measures are computed once, here, so that another runtime only makes the boundary
vector and runs two graphs per frame, and gets the same hair as a bake.
"""

import hashlib
import re
from collections.abc import Sequence

import numpy as np

from neuralocks_core.deformation.clumping import Locks
from neuralocks_core.deformation.root_skin import RootSkin
from neuralocks_core.deformation.strand_session import StrandSession, rest_edges
from neuralocks_core.models.network_sizes import HIDDEN, SHAPE, K
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.rotation import rotation_part, sizes

from ..baking.points.placing import GroomPlacer
from ..shot.stage import StageGroom

ARRAYS = {
    "rest": f"(S, {K}, 3) float32, the strands at rest in canonical space [m]: even in arc length of the author's, and where "
    "these wind finer, the line that they wind around. A bake's points are these strands where a groom is already so; any "
    "other groom's own points follow them",
    "valid": "(S,) bool, false where a strand is one point: its displacement is 0",
    "strand_part": f"(S, {HIDDEN}) float32, input of tail.onnx",
    "anchor": f"(S, {SHAPE}) float32, input of tail.onnx, for the default material and the body shape of the first frame: "
    "`offsets` of tail.onnx with `anchor` zero and the frame `held`; zeros where the model is not anchored",
    "edges": f"(S, {SHAPE}) float32, input of tail.onnx",
    "held": "(F,) float32, boundary vector of the bind pose, held",
    "facing": "(3, 3) float64, rotation from bind-world to canonical axes",
    "canonical_to_head": "(4, 4) float64, from canonical space to that of the head joint. The joint's world transform times this "
    "takes strands to the world: its linear part as the stage has it divided by `size`, its place in metres, both turned to Y up",
    "size": "() float64, size (cube root of the determinant) of that linear part at which hair is as long as in `rest`: that of "
    "the joint's bind transform, times the median over the shot of how much larger it shows the head. Hair grows as its joint does",
    "bind": "(n, 3, 3) float64, world rotations in the bind pose of the joints that `joints` names: head, upper chest, then the "
    "pose joints",
    "stance": "(p, 3, 3) float64, of the pose joints in their order",
    "length": "(S,) float32, of each strand [m], for `clumping`",
    "tie": "(S,) float32, how firmly each strand is tied into its lock, for `clumping`",
    "lock": "(S,) int32, number of each strand's lock as far as it is tied together, for `clumping`",
}
"""Arrays of a groom's file -> what they are."""
LONGEST_NAME = 150
"""Bytes of a groom's file name without its ending, at most."""


def export_grooms(grooms: Sequence[StageGroom], model: StrandModel, put) -> dict[str, dict]:
    """Write `NAME.npz` with ARRAYS of each groom of a shot.

    Args:
        grooms: of the shot.
        model: that moves them.
        put: file name -> path to write it to.

    Returns:
        File name -> {"prim", "skeleton": prim path, "strands", "joints": {"head": joint path, "upper chest": joint path, "pose": joint paths}}.
    """
    written = {}
    names = file_names([item.path for item in grooms])
    for name, item in zip(names, grooms, strict=True):
        arrays, joints = tables(item, model)
        np.savez(put(name), **arrays)
        rig = item.attachment.rig.path
        written[name] = {"prim": item.path, "skeleton": rig, "strands": len(arrays["rest"]), "joints": joints}
    return written


def file_names(paths: list[str]) -> list[str]:
    """A file name for each prim path; they differ in more than case, because some disks ignore case."""
    names: dict[str, str] = {}
    number: dict[str, int] = {}
    for path in paths:
        stem = name = _short(re.sub(r"\W+", "_", path.strip("/")))
        while name.casefold() in names:
            number[stem] = number.get(stem, 1) + 1
            name = f"{stem}_{number[stem]}"
        names[name.casefold()] = name
    return [f"{name}.npz" for name in names.values()]


def _short(stem: str) -> str:
    """A name that disks, which allow 255 bytes, can hold: its end, which tells most, after a digest of the whole."""
    if len(stem.encode()) <= LONGEST_NAME:
        return stem
    digest = hashlib.sha256(stem.encode()).hexdigest()[:8]
    return f"{digest}_{stem.encode()[9 - LONGEST_NAME :].decode(errors='ignore')}"


def tables(item: StageGroom, model: StrandModel) -> tuple[dict[str, np.ndarray], dict]:
    """ARRAYS of one groom, and the joints whose motion its boundary vector is made of."""
    character, rig = item.attachment.character, item.attachment.rig
    sampler = model.sampler(character, rig.clip)
    strands, held = GroomPlacer(item).strands, sampler.held_bind()
    locks = Locks.of(strands)
    session = StrandSession(model, strands)
    session.anchor(held)
    skeleton, joint = character.skeleton, character.carrying_joint
    arrays = {
        # What the network reads of a strand does not move with its root.
        "rest": RootSkin(character, [strands], rig.clip).begun(strands).rest,
        "valid": strands.valid,
        "strand_part": session.strand_part,
        "anchor": session.anchor_offsets,
        "edges": rest_edges(strands.rest),
        "held": held,
        "facing": character.facing,
        "canonical_to_head": character.inverse_bind[joint] @ character.canonical_to_bind,
        "size": np.abs(sizes(rig.to_bind @ rig.joints.bind[joint])) / rig.border.metres_per_unit,
        "bind": rotation_part(skeleton.bind[sampler.joints], "bind pose"),
        "stance": sampler.stance,
        "length": strands.length.astype(np.float32),
        "tie": locks.tie.astype(np.float32),
        "lock": locks.lock.astype(np.int32),
    }
    head, chest, *pose = (skeleton.names[joint] for joint in sampler.joints)
    return arrays, {"head": head, "upper chest": chest, "pose": pose}
