# SPDX-License-Identifier: Apache-2.0
"""Which body a groom belongs to that sits on several equally well: twins, or one person in two skeletons."""

import numpy as np
from pxr import Sdf, Usd

from neuralocks_core.anatomy.joint_names import words
from neuralocks_core.errors import NeuralocksError

from ...skel.stage_rig import StageRig
from .seat import Seat, kinship
from .ways import CLEARLY

SAME = 0.01
"""Joints of two skeletons at most this far apart [m] are one."""
UPPER = ("head", "neck", "upper_chest", "chest")
"""Joints by which the same person is recognised."""


def one_of_alike(prim: Usd.Prim, seats: list[Seat], notes: list[str]) -> Seat:
    """The seat on the body whose prims the groom is among; otherwise on the body that shares its name, that it sits on by a
    likelier way, or that is clearly nearer.

    Args:
        prim: a groom.
        seats: on bodies that are alike; not empty.
        notes: a note is added here if another body would do, by a less likely way.

    Raises:
        NeuralocksError: several are equally likely.
    """
    kin = max(kinship(prim, seat.rig.joints.prim) for seat in seats)
    likely = _sharing_a_name(prim, [seat for seat in seats if kinship(prim, seat.rig.joints.prim) == kin])
    best = min(likely, key=lambda seat: (seat.way, seat.distance))
    others = [seat for seat in likely if seat is not best and not one_person(best.rig, seat.rig)]
    near = CLEARLY * best.distance + 1e-4
    tied = [seat for seat in others if seat.way == best.way and seat.distance <= near]
    if tied:
        names = ", ".join(seat.rig.path for seat in [best, *tied][:5])
        raise NeuralocksError(
            f"{prim.GetPath()}: sits equally well on the bodies of {len(tied) + 1} skeletons ({names}); "
            "choose one with --skeleton PRIM, for this groom alone with --groom"
        )
    if others:
        notes.append(
            f"{prim.GetPath()}: is taken as hair of {best.rig.path}, by where that stands; the body of {others[0].rig.path} is "
            "as near in its bind pose: if the hair is that one's, bind it, or name both with --groom and --skeleton"
        )
    return best


def one_person(rig: StageRig, other: StageRig) -> bool:
    """Whether a joint of the upper body is at the same place in both, when bound and as the first one's motion begins and ends."""
    mine, its = rig.character, other.character
    ends = rig.clip.times[[0, -1]]
    for name in UPPER:
        if name not in mine.humanoid or name not in its.humanoid:
            continue
        a, b = mine.humanoid[name], its.humanoid[name]
        there = np.concatenate([mine.skeleton.bind[None, a], rig.clip.joints[[0, -1], a]])[:, :3, 3]
        if np.abs(there[0] - its.skeleton.bind[b, :3, 3]).max() < SAME:
            return bool(np.abs(there[1:] - other.clip.at(ends)[:, b, :3, 3]).max() < SAME)
    return False


def _sharing_a_name(prim: Usd.Prim, seats: list[Seat]) -> list[Seat]:
    """Those on a skeleton whose path shares most names with the groom's."""
    own = _names(prim.GetPath())
    shared = [len(own & _names(seat.rig.joints.prim.GetPath())) for seat in seats]
    return [seat for seat, count in zip(seats, shared, strict=True) if count == max(shared)]


def _names(path: Sdf.Path) -> set[str]:
    """The prims of a path, and the words of their names."""
    parts = str(path).strip("/").split("/")
    return {name for part in parts for name in (part.lower(), *words(part))}
