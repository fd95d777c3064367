# SPDX-License-Identifier: Apache-2.0
"""The skeletons of a stage that can be used. If names do not tell the head, it is the joint that carries the hair."""

from dataclasses import replace

from pxr import Usd

from neuralocks_core.anatomy.humanoid import NoHead
from neuralocks_core.errors import NeuralocksError

from ...border.placement import Placement
from ...border.units import Border
from ...skel.binding import bound_skeleton
from ...skel.source import read_rig
from ...skel.stage_rig import StageRig
from ...skel.surface import find_skins
from ..bakes.bake_record import recorded_joint
from ..carriers.attach import bound_joint
from ..strands.curves import find_curves, rest_points, without_points


def read_each_rig(
    stage: Usd.Stage, prims: list[Usd.Prim], border: Border, head: str | None = None, *, cuts=None, **options
) -> tuple[list[StageRig], list[NeuralocksError]]:
    """`read_rig` of several skeletons: those that can be used, and what is wrong with the others.

    Where no joint is named like a head, it is the one that a bake of this stage's hair was made with, or that most of the
    hair follows by its own binding; or, where no other skeleton has a head, by that of the mesh on which it sits. So a hat
    or a prop near by takes no hair from the head under it.

    Args:
        stage, border, head, options: as for `read_rig`.
        prims: the Skeletons.
        cuts: those of all skeletons, or a dictionary of them by path.
    """
    rigs, errors, unnamed, skins = [], [], [], find_skins(stage)
    for prim in prims:
        own = cuts.get(str(prim.GetPath())) if isinstance(cuts, dict) else cuts
        facts = {**options, "cuts": own, "skins": skins}
        try:
            rigs.append(read_rig(stage, prim, border, head, **facts))
        except NoHead as error:
            unnamed.append((prim, facts, error))
        except NeuralocksError as error:
            errors.append(error)
    alone = not rigs
    for prim, facts, no_head in unnamed:
        try:
            found = _carrying(read_rig(stage, prim, border, headless=True, **facts), seated=alone)
            if found is None:
                raise no_head
            rigs.append(_explained(read_rig(stage, prim, border, found[0], **facts), found[1]))
        except NeuralocksError as error:
            errors.append(error)
    order = [str(prim.GetPath()) for prim in prims]
    return sorted(rigs, key=lambda rig: order.index(rig.path)), errors


def _carrying(rig: StageRig, seated: bool) -> tuple[str, str] | None:
    """The joint that carries the groom of most points, and how that is known; None if nothing says so.

    Raises:
        NeuralocksError: nothing says so, but the binding of a groom that is bound to this skeleton would, were it not broken.
    """
    broken: list[NeuralocksError] = []
    curves = find_curves(rig.joints.prim.GetStage())
    empty = without_points(curves)
    for prim in sorted((p for p in curves if p not in empty), key=_points_of, reverse=True):
        told = recorded_joint(prim)
        if told in rig.joints.names:
            return told, f"told by the bake of {prim.GetPath()}"
        try:
            found = bound_joint(prim, rig, Placement(prim), seated)
        except NeuralocksError as error:  # of others, it is reported when this groom is read
            broken += [error] if bound_skeleton(prim) == rig.path else []
            continue
        if found is not None:
            return found[0], f"by the binding of {found[1]}"
    if broken:
        raise broken[0]
    return None


def _points_of(prim: Usd.Prim) -> int:
    """How many points curves have; 0 if they cannot be read, which matters only if they are hair."""
    try:
        return len(rest_points(prim))
    except NeuralocksError:
        return 0


def _explained(rig: StageRig, why: str) -> StageRig:
    humanoid = rig.character.humanoid
    humanoid = replace(humanoid, reasons={**humanoid.reasons, "head": why})
    by_hand = {name: joint for name, joint in rig.by_hand.items() if name != "head"}
    return replace(rig, character=replace(rig.character, humanoid=humanoid), by_hand=by_hand)
