# SPDX-License-Identifier: Apache-2.0
"""Notes on how a groom sits on skin: off it, reversed, or drawn from above it; and on one too far away to be placed exactly."""

import numpy as np
from pxr import Usd

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.character import Character
from neuralocks_core.deformation.root_skin import ASTRAY
from neuralocks_core.rotation import inverse, sizes, strayed, transformed

from ...border.placement import Placement
from ...skel.stage_rig import StageRig
from ..strands.curve_ends import Beyond
from .seat import NEAR, Seat, either_ends, off_skin, some_ends, some_places
from .ways import CLEARLY, SOME_TIMES

STRAYS = 0.01
"""Less motion of hair relative to what carries it [m] is not told."""
TOUCHES = 0.003
"""Points this near to skin [m], in the median, grow out of it or are pressed onto it."""
COARSE = 2e-4
"""If single precision can only put points this far apart [m], strands, which are about half as thick, tremble."""
LEVEL = 0.001
"""Points nearer to skin than this [m] are all alike: skins are only as smooth as their triangles."""


def lies_off_skin(prim: Usd.Prim, seat: Seat) -> str:
    """The note on hair without a binding that lies off the skin of its carrier."""
    return (
        f"{prim.GetPath()}: its roots lie {seat.distance:.2g} m from the skin of {seat.rig.path}"
        f"{seat.rig.border.foreign(prim.GetAttribute('points'))} and keep that distance; "
        "check that it was made for this pose"
    )


def strays(prim: Usd.Prim, rig: StageRig, placement: Placement) -> list[str]:
    """The note on hair without a binding whose own transform nearly keeps to the carrying joint, but moves relative to it, as on a
    jaw that another skeleton moves.
    """
    if not placement.samples or not rig.joints.animated:
        return []
    times, core = placement.samples[:: max(1, len(placement.samples) // SOME_TIMES)], rig.border.to_core
    middle = some_ends(prim).mean(axis=0)
    path = np.stack([transformed(middle, core @ placement.at(time)) for time in times])
    far = strayed(path, np.stack([rig.carrying_at(time) for time in times]))
    if not STRAYS < far < np.inf:
        return []
    with_all = strayed(path, np.stack([core @ rig.joints.placement.at(time) for time in times]))
    if CLEARLY * far >= with_all:
        return []
    joint = leaf(rig.joints.names[rig.character.carrying_joint])
    return [
        f"{prim.GetPath()}: its own transform moves it by up to {1e3 * far:.0f} mm relative to joint '{joint}' of {rig.path}, which "
        "carries it; a bake does not follow that: bind it to the joint that it should follow"
    ]


def astray(prim: Usd.Prim, rig: StageRig, to_bind: np.ndarray) -> list[str]:
    """The note on hair whose own binding puts it far from the skin, as a wrong unit or bind transform does."""
    if not rig.skins:
        return []
    far = off_skin(some_ends(prim), rig, to_bind)
    if far <= ASTRAY * rig.character.times_human:
        return []
    return [
        f"{prim.GetPath()}: its skel binding puts its roots {far:.2g} m from the skin of {rig.path}; "
        "check its unit and primvars:skel:geomBindTransform"
    ]


def upside_down(prim: Usd.Prim, rig: StageRig, to_bind: np.ndarray) -> list[str]:
    """The note on strands whose last points lie on skin while their first ones do not."""
    if not rig.skins:
        return []
    first, last = (off_skin(some_ends(prim, last=last), rig, to_bind) for last in (False, True))
    if first <= NEAR:
        # Most hair's last points are much farther from the skin's points; then nothing is measured more exactly.
        first = _turned_round(prim, rig, to_bind) if last <= CLEARLY * first else 0.0
    if last > NEAR or not first:
        return []
    return [
        f"{prim.GetPath()}: its strands seem to run from tip to root: their last points lie on the skin of {rig.path}, "
        f"their first ones {first:.2g} m away; reverse the strands"
    ]


def _turned_round(prim: Usd.Prim, rig: StageRig, to_bind: np.ndarray) -> float:
    """How far above skin the first points of hair near to it lie [m]; 0 unless its last ones are clearly its roots.

    Short hair is near to skin all along, and the tips of long hair lie on shoulders. Shoulders do not follow the head, so if only
    one end of the strands does, it is more likely the root.
    """
    body, head = rig.character.body, rig.character.humanoid.get("head")
    if rig.surface is None:  # no more can be said than how far its points are
        return 0.0

    def on_head(points: np.ndarray) -> float:
        below = rig.vertices.query(points)[1]
        return float((body.joint_weights[below] * rig.character.of_head[body.joint_indices[below]]).sum(axis=1).mean())

    def told(last: bool) -> tuple[float, float]:
        """Distance [m] and share on the head; roots that begin inside of skin are on it."""
        ends = [transformed(points, to_bind) for points in either_ends(prim, last=last)]
        far = [rig.surface.distance(points)[0] for points in ends]
        middle = min(float(np.median(abs(each) if last else each.clip(0))) for each in far)
        return middle, 0.0 if head is None else on_head(ends[-1])

    (first, first_on_head), (last, last_on_head) = told(last=False), told(last=True)
    gained = last_on_head - first_on_head
    least = CLEARLY * (max(last, LEVEL) if gained > 0.5 else TOUCHES)
    return first if last <= TOUCHES and first > least and gained > -0.2 else 0.0


def not_pinned(prim: Usd.Prim, rig: StageRig, drawn: bool, beyond: Beyond | None) -> list[str]:
    """The note on curves that begin on skin but are drawn from above it, because they lack the points beyond their ends."""
    if drawn or beyond is None or not len(beyond.before) or not rig.skins:
        return []
    return [
        f"{prim.GetPath()}: its curves are not pinned, so they are drawn from their second points on, but the first ones lie "
        "on the skin and are taken for the roots; set their wrap to pinned"
    ]


def coarsely_placed(prim: Usd.Prim, rig: StageRig, character: Character, placement: Placement) -> list[str]:
    """The note on hair so far from its prim's origin, where joints or points in world space put it, that the prim's points are
    not exact enough there.
    """
    rows, to_world = some_places(rig, placement)
    worst, away = 0.0, 0.0
    for place, way in zip(rig.clip.joints[rows, character.carrying_joint, :3, 3], to_world):
        own, unit = transformed(place, inverse(way)), abs(sizes(way))
        step = float(np.spacing(np.float32(abs(own).max()))) * unit
        worst, away = max((worst, away), (step, float(np.linalg.norm(own)) * unit))
    if worst < COARSE:
        return []
    return [
        f"{prim.GetPath()}: the head is up to {away:.0f} m from this prim's origin, where points only move in steps of {1000 * worst:.2g} mm, "
        "so its strands tremble; move the character there by a transform above its hair"
    ]
