# SPDX-License-Identifier: Apache-2.0
"""Notes on grooms: why one is left out, and what is odd about its strands."""

import numpy as np
from pxr import Usd

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.groom import Groom
from neuralocks_core.strands.arclength import count_pointlike

from ...border.units import Border
from ...skel.stage_rig import StageRig
from ..carriers.attach import Attachment


def groom_notes(prim: Usd.Prim, groom: Groom, border: Border) -> list[str]:
    """The notes on strands without length and on lengths that no hair has."""
    path = str(prim.GetPath())
    notes = []
    filled = np.flatnonzero(groom.counts > 0)
    spread = np.zeros(groom.strand_count, np.float32)
    low = np.minimum.reduceat(groom.points, groom.starts[filled])
    high = np.maximum.reduceat(groom.points, groom.starts[filled])
    spread[filled] = (high - low).max(axis=1)
    still = count_pointlike(groom)
    if still:
        notes.append(
            f"{path}: {still} of {groom.strand_count} strands have no two distinct points; they follow the head rigidly"
        )
    longest = float(spread.max())
    if longest > 2.5 or 0 < longest < 0.002:  # points alone say nothing about a unit
        remedy = border.foreign(prim.GetAttribute("points")) or "; check the stage's metersPerUnit"
        notes.append(f"{path}: the longest strand reaches {longest:.3g} m{remedy}")
    return notes


def no_points(path: str) -> str:
    """The note on a prim of curves without points, if others have some."""
    return f"{path}: the curves have no points; left out"


def stands_still(path: str, rig: StageRig) -> str:
    """The note on a groom whose character is not animated, if others are."""
    return f"{path}: {rig.path}, which carries it, has no animation; left out"


def another_carries(path: str, rig: StageRig) -> str:
    """The note on a groom that is carried by a different skeleton than the one the user named."""
    return f"{path}: is carried by {rig.path}; left out, or name it with --groom"


def another_binds(path: str, own: str) -> str:
    """The note on a groom that is bound to a different skeleton than the one the user named."""
    return f"{path}: is bound to {own}; left out, or name it with --groom"


def far_from_named(prim: Usd.Prim, found: Attachment) -> str:
    """The note on a groom that lies too far from the skeleton that the user named to be its hair."""
    return (
        f"{prim.GetPath()}: lies {found.far:.3g} m from the head of {found.rig.path}; left out, or name it with --groom"
    )


def unusable_skeleton(path: str, own: str, bound: bool, named: bool = False) -> str:
    """The note on a groom whose own skeleton cannot be used, as another note says: nothing else may carry it. If the user named it,
    why it is refused.
    """
    how, unbound = ("is bound to", "unbind the hair and ") if bound else ("lies on the character of", "")
    fact = "cannot be used, as neuralocks inspect explains" if named else "cannot be used, and is left out with it"
    return f"{path}: {how} {own}, which {fact}; fix that skeleton, or {unbound}name another for it with --groom and --skeleton"


def too_far(prim: Usd.Prim, found: Attachment, named: bool = False) -> str:
    """The note on curves that start too far from any head to be taken for hair, unless their user named them."""
    where = (
        f"{prim.GetPath()}: lies {found.far:.3g} m from joint '{leaf(found.joint)}' of {found.rig.path} "
        f"and on no skin{found.rig.border.foreign(prim.GetAttribute('points'))}"
    )
    if named:
        return f"{where}, and keeps that distance; put it where the head is in the bind pose or the shot's first frame"
    return f"{where}, so it is not taken for hair; if it is, name it with --groom"
