# SPDX-License-Identifier: Apache-2.0
"""Notes on how a groom sits on skin: off it, upside down, drawn from above it, or on a face that moves away below it."""

import numpy as np
from pxr import Usd
from scipy.spatial import cKDTree

from ..border.placement import Placement
from ..skel.source import StageRig
from .curve_ends import Beyond
from .seat import NEAR, find_seat, off_skin, some_ends

MOVES = 0.002
"""Skin that blend shapes move by less [m] stays with its roots."""


def lies_off_skin(prim: Usd.Prim, rig: StageRig, placement: Placement) -> list[str]:
    """The note on hair without a binding that lies off the skin of its carrier."""
    seat = find_seat(prim, rig, placement)
    if seat is None:
        return []
    return upside_down(prim, rig, seat.to_bind) or [
        f"{prim.GetPath()}: its roots lie {seat.distance:.2g} m from the skin of {rig.path}"
        f"{rig.border.foreign(prim.GetAttribute('points'))} and keep that distance; "
        "check that it was made for this pose"
    ]


def upside_down(prim: Usd.Prim, rig: StageRig, to_bind: np.ndarray) -> list[str]:
    """The note on strands whose last points lie on skin while their first ones do not."""
    if not rig.skins:
        return []
    roots = off_skin(some_ends(prim), rig, to_bind)
    if roots <= NEAR or off_skin(some_ends(prim, last=True), rig, to_bind) > NEAR:
        return []
    return [
        f"{prim.GetPath()}: its strands seem to run from tip to root: their last points lie on the skin of {rig.path}, "
        f"their first ones {roots:.2g} m away; reverse the strands"
    ]


def not_pinned(prim: Usd.Prim, rig: StageRig, drawn: bool, beyond: Beyond | None) -> list[str]:
    """The note on curves that begin on skin but are drawn from above it, for they lack the points beyond their ends."""
    if drawn or beyond is None or not len(beyond.before) or not rig.skins:
        return []
    return [
        f"{prim.GetPath()}: its curves are not pinned, so they are drawn from their second points on, but the first ones lie "
        "on the skin and are taken for the roots; set their wrap to pinned"
    ]


def moved_away(path: str, rig: StageRig, roots: np.ndarray) -> list[str]:
    """The note on a groom whose skin a blend shape moves during the shot; its roots (n, 3) in bind world [m]."""
    body, spans = rig.character.body, np.ptp(rig.clip.shape, axis=0)
    if body is None or not spans.any():
        return []
    below = cKDTree(body.points).query(roots)[1]
    ways = {
        name: span * float(np.percentile(np.linalg.norm(offsets[below], axis=1), 90))
        for (name, offsets), span in zip(body.shapes.items(), spans, strict=True)
    }
    name = max(ways, key=ways.get)
    if ways[name] < MOVES:
        return []
    return [
        f"{path}: blend shape '{name}' moves the skin below it by up to {1000 * ways[name]:.2g} mm; its roots stay with the "
        "joint that carries them"
    ]
