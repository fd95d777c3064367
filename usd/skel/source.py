# SPDX-License-Identifier: Apache-2.0
"""A skeleton of the stage as a Character and a Clip: metres, Y up, world space."""

from dataclasses import replace

import numpy as np
from pxr import Usd, UsdSkel

from neuralocks_core.anatomy.humanoid import Humanoid, NoHead, find_humanoid
from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.animation.cuts import find_cuts
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.errors import NeuralocksError, reworded
from neuralocks_core.motion import Clip

from ..border.amounts import joints_by_hand
from ..border.prim_paths import some_paths
from ..border.units import Border
from .bind_world import to_bind_world
from .blend_shapes import all_shares, knot_weights
from .clip_codes import clip_codes
from .cut_samples import cut_samples
from .facing import backwards_notes
from .joints import JointSource
from .old_copy import copy_notes, is_outdated
from .stage_rig import StageRig, joint_trim
from .surface import Skins, bound_meshes, find_skins, merged_body, moved_joints, not_posed, seen_in_turn


def read_rig(
    stage: Usd.Stage,
    prim: Usd.Prim,
    border: Border,
    head: str | None = None,
    *,
    all_shapes: bool = False,
    joints=None,
    cuts: list[float] | None = None,
    skins: Skins | None = None,
    headless: bool = False,
    unbaked: bool = False,
) -> StageRig:
    """Read a skeleton, its meshes and its motion.

    Args:
        stage: the shot.
        prim: the Skeleton.
        border: the stage's units.
        head: joint that is the head; found by name and hierarchy if left out.
        all_shapes: keep blend shapes that the animation does not use.
        joints: semantic joint -> joint path or its last part, if names are not enough.
        cuts: time codes at which the character is suddenly elsewhere; detected if None. Those outside the animation are ignored.
        skins: of the stage, if they were looked for already.
        headless: if no joint is named like a head, read it without one, and without any other semantic joint.
        unbaked: for a rig bake, read the animation that it was made from, with a note if the two differ.

    Raises:
        NoHead: no joint is named like a head.
        NeuralocksError: something in it cannot be used; the message names the prim.
    """
    source = JointSource(prim, unbaked)
    notes = source.notes
    time_codes = clip_codes(source, border)
    outdated = is_outdated(source, time_codes)
    notes += copy_notes(source, outdated)
    posed = source.posed(time_codes)
    meshes = bound_meshes(find_skins(stage) if skins is None else skins, source, notes)
    notes += not_posed(meshes, source) + seen_in_turn(meshes)
    by_hand = joints_by_hand(head, joints)
    try:
        humanoid = _humanoid(source, by_hand, moved_joints(meshes, len(source.names)))
    except NoHead:
        if not headless:
            raise
        humanoid = Humanoid({})
    notes += _twice(source, by_hand, humanoid)
    to_bind = to_bind_world(source, border, posed, humanoid)
    trim = joint_trim(source, to_bind)
    skeleton = Skeleton(source.names, source.parents, to_bind @ source.bind @ trim)
    knots = knot_weights([mesh.shapes for mesh in meshes])
    weights = source.shape(list(knots), time_codes)
    used = weights.any(axis=0) | all_shapes
    knots = {name: own for (name, own), kept in zip(knots.items(), used, strict=True) if kept}
    body = merged_body(meshes, to_bind, knots)
    character = Character(skeleton, body, humanoid)
    notes += backwards_notes(source, character)
    clip = Clip(
        border.seconds(time_codes),
        border.to_core @ posed @ trim,
        all_shares(weights[:, used], knots),
    )
    if cuts is not None:
        joint = character.head if "head" in humanoid else 0
        known = clip.times[cut_samples(cuts, time_codes, border.frame, clip.joints[:, joint].reshape(-1, 16))]
    else:
        known = find_cuts(clip, character.head) if "head" in humanoid else ()
    clip = replace(clip, cuts=known)
    return StageRig(
        path=source.path,
        joints=source,
        border=border,
        meshes=meshes,
        to_bind=to_bind,
        character=character,
        clip=clip,
        time_codes=time_codes,
        knots=knots,
        notes=notes,
        by_hand=by_hand,
        outdated=outdated,
    )


def find_skeletons(stage: Usd.Stage, wanted: str | None = None) -> list[Usd.Prim]:
    """Skeleton prims in stage order; only the one `wanted` by its path, or by a name that no other has.

    Raises:
        NeuralocksError: there is no such skeleton, or there are several.
    """
    every = [prim for prim in stage.Traverse(Usd.TraverseInstanceProxies()) if prim.IsA(UsdSkel.Skeleton)]
    if wanted is None:
        return every
    found = [prim for prim in every if wanted in (str(prim.GetPath()), prim.GetName())]
    if len(found) != 1:
        others, fact = (found, "several skeletons have this name") if found else (every, "no such skeleton")
        raise NeuralocksError(f"{wanted}: {fact}; give the path of one of: {some_paths(others)}")
    return found


def _humanoid(source: JointSource, by_hand: dict[str, str], skinned: np.ndarray) -> Humanoid:
    try:
        return find_humanoid(source.names, source.parents, source.bind[:, :3, 3], by_hand, skinned)
    except NeuralocksError as error:
        raise reworded(error, f"{source.path}: {str(error).removeprefix('skeleton: ')}") from None


def _twice(source: JointSource, by_hand: dict[str, str], humanoid: Humanoid) -> list[str]:
    """The notes on joints that the user gave a second meaning: a joint does not turn relative to itself."""
    said = {}
    for name in by_hand:
        others = [other for other in humanoid if other != name and humanoid[other] == humanoid[name]]
        if others:
            joint = leaf(source.names[humanoid[name]])
            meanings = " and ".join(sorted([name, *others]))
            said[joint] = f"{source.path}: joint '{joint}' is {meanings} at once; check --joint and --head"
    return list(said.values())
