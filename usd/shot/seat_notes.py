# SPDX-License-Identifier: Apache-2.0
"""Notes on how a groom sits on skin: off it, upside down, drawn from above it only, or on a face that moves away below it."""

import numpy as np
from pxr import Usd
from scipy.spatial import cKDTree

from neuralocks_core.rotation import transformed

from ..border.placement import Placement
from ..skel.source import StageRig
from .curve_ends import beyond_ends
from .curves import rest_points
from .seat import NEAR, SOME_ROOTS, Seat, find_seat, some_ends

MOVES = 0.002
"""Skin that blend shapes move by less [m] stays with its roots."""


def lies_off_skin(prim: Usd.Prim, rig: StageRig, placement: Placement) -> list[str]:
    """The note on hair without a binding that lies off the skin of its carrier."""
    seat = find_seat(prim, rig, placement)
    if seat is None:
        return []
    return (
        upside_down(prim, rig, seat.to_bind)
        or drawn_short(prim, rig, seat)
        or [
            f"{prim.GetPath()}: its roots lie {seat.distance:.2g} m from the skin of {rig.path}"
            f"{rig.border.foreign(prim.GetAttribute('points'))} and keep that distance; "
            "check that it was made for this pose"
        ]
    )


def upside_down(prim: Usd.Prim, rig: StageRig, to_bind: np.ndarray) -> list[str]:
    """The note on strands whose last points lie on skin while their first ones do not."""
    if not rig.skins:
        return []
    roots = _off_skin(some_ends(prim), rig, to_bind)
    if roots <= NEAR or _off_skin(some_ends(prim, last=True), rig, to_bind) > NEAR:
        return []
    return [
        f"{prim.GetPath()}: its strands seem to run from tip to root: their last points lie on the skin of {rig.path}, "
        f"their first ones {roots:.2g} m away; reverse the strands"
    ]


def drawn_short(prim: Usd.Prim, rig: StageRig, seat: Seat) -> list[str]:
    """The note on curves whose first points lie on skin but are not drawn, for they lack the points beyond their ends."""
    beyond = beyond_ends(prim)
    if beyond is None or not len(beyond.before):
        return []
    first = rest_points(prim)[beyond.before[:: max(1, len(beyond.before) // SOME_ROOTS)]]
    first = first[np.isfinite(first).all(axis=1)]
    if not len(first) or _off_skin(first, rig, seat.to_bind) > NEAR:
        return []
    return [
        f"{prim.GetPath()}: its curves are not pinned, so they are drawn from their second points on, {seat.distance:.2g} m "
        "from the skin on which the first ones lie; set their wrap to pinned"
    ]


def _off_skin(points: np.ndarray, rig: StageRig, to_bind: np.ndarray) -> float:
    """Distance of points (n, 3) from the nearest skin, in the median [m]."""
    far = [tree.query(transformed(points, to_bind))[0] for tree in rig.skins]
    return float(np.median(np.min(far, axis=0)))


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
