# SPDX-License-Identifier: Apache-2.0
"""Where curves without a binding lie in a rig's bind pose, and on which skin.

A file does not say what the transform of such curves refers to: the bind pose, a skin elsewhere in the stage, or the pose
at one moment. For curves that move with the head or are a moving cache it is a moment; for the rest, it is whichever puts
their roots on skin.
"""

from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from pxr import Usd

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import transformed

from ...border.placement import Placement
from ...skel.skin import Skin
from ...skel.stage_rig import StageRig
from ...skel.surface import StageMesh
from ..strands.curve_ends import Beyond, beyond_ends, ends
from ..strands.curves import moment, rest_points
from .ways import CLEARLY, SOME_TIMES, STEADY, drifts_of, rest_way, ways

NEAR = 0.03
"""Roots this far from a mesh, in the median, still sit on it [m]."""
UNEVEN, SURELY = 1e-3, 5
"""Roots that a likely way puts near skin, but UNEVEN [m] or more `_off_faces`, are taken by another way if they are SURELY times less
so by it."""
UNSURE = 5e-3
"""Roots that are on faces may be farther from their corners than others that are not, but hardly by more than this [m]."""
HOVER = 0.1
"""How much the same distance of all roots from the skin counts, beside how much the distances differ."""
ON_FACES, MANY = 5e-3, 5
"""Hair that is on no skin otherwise was made in the rest pose if its roots are no farther than this from faces there, in the median [m],
and all alike; fewer than so MANY must be right on them."""
SOME_ROOTS = 1000
"""About how many of a groom's roots are looked at: all would be too many."""

APART = 5e-3
"""Places of a groom this far from each other [m] look different."""


@dataclass(frozen=True)
class Seat:
    """How a groom would sit on a rig's nearest mesh.

    Attributes:
        distance: of its roots from the mesh, in the median [m].
        rig, mesh: on what.
        to_bind: its way to bind world, (4, 4).
        way: whether that way is unlikely, and its place among `ways`.
        roots: of some strands, in bind world [m], (n, 3).
        skin: the mesh there.
    """

    distance: float
    rig: StageRig
    mesh: StageMesh
    to_bind: np.ndarray
    way: tuple[bool, int]
    roots: np.ndarray = field(repr=False)
    skin: Skin = field(repr=False)

    @property
    def points(self) -> np.ndarray:
        """The mesh's nearest point to each root (n,)."""
        return self.skin.query(self.roots)[1]


def find_seat(
    prim: Usd.Prim, rig: StageRig, placement: Placement, within: float = np.inf, *, last: bool = False
) -> Seat | None:
    """A groom on a rig's nearest skin, by its strands' first or last points; None if the rig has no skin, or none `within` this
    distance [m].
    """
    seats = [_find_seat(roots, moment(prim), rig, placement, within) for roots in either_ends(prim, last=last)]
    return min((seat for seat in seats if seat is not None), key=lambda seat: seat.distance, default=None)


def begins_where_drawn(prim: Usd.Prim, rig: StageRig, to_bind: np.ndarray, beyond: Beyond | None) -> bool:
    """Whether hair begins where its curves are drawn, rather than at points `beyond`: skin says which of them are the roots."""
    if beyond is None or not rig.skins:
        return False
    return off_skin(some_ends(prim, beyond=beyond), rig, to_bind) <= off_skin(some_ends(prim), rig, to_bind)


def off_skin(points: np.ndarray, rig: StageRig, to_bind: np.ndarray) -> float:
    """Distance of points (n, 3) of a prim from the nearest skin of a rig that has some, in the median [m]."""
    far = [skin.query(transformed(points, to_bind))[0] for skin in rig.skins]
    return float(np.median(np.min(far, axis=0)))


def either_ends(prim: Usd.Prim, *, last: bool = False) -> list[np.ndarray]:
    """`some_ends` of all points and, if some are beyond the drawn ones, of the drawn ones."""
    beyond = beyond_ends(prim)
    return [some_ends(prim, last=last, beyond=each) for each in ([None] if beyond is None else [None, beyond])]


def _find_seat(
    roots: np.ndarray, when: float | None, rig: StageRig, placement: Placement, within: float
) -> Seat | None:
    best = None
    drifts = None if when is not None or not rig.meshes else drifts_of(rig, placement)  # the same for all meshes
    for likely in (True, False):
        if best is not None and best.distance <= NEAR:
            break
        for mesh, skin in zip(rig.meshes, rig.skins, strict=True):
            for place, to_bind in enumerate(ways(rig, mesh, placement, when, likely=likely, drifts=drifts)):
                placed, way = transformed(roots, to_bind), (not likely, place)
                # In a crowd nearly all skins are far, and finding the nearest point of a far one takes a hundred times as long as
                # finding that none is near. Twice the bound, because what is nearer by another way must be CLEARLY nearer.
                middle = float(np.median(skin.query(placed, CLEARLY * within)[0]))
                clear = CLEARLY if best is not None and way > best.way else 1
                if np.isfinite(middle) and (best is None or clear * middle < best.distance - 1e-4):
                    best = Seat(middle, rig, mesh, to_bind, way, placed, skin)
    at_rest = rest_way(rig, placement, when, drifts) if rig.meshes else None
    if best is not None and best.distance <= NEAR:
        others = ways(rig, best.mesh, placement, when, likely=False, drifts=drifts)
        return _on_faces(best, roots, [*others, *([] if at_rest is None else [at_rest])]) or best
    if at_rest is not None and (seat := _on_skin_at_rest(rig, roots, at_rest)) is not None:
        return seat
    return best if best is not None and best.distance <= within else None


def _on_faces(seat: Seat, roots: np.ndarray, others: list[np.ndarray]) -> Seat | None:
    """The seat by another way that puts roots right onto the skin, near which they only are by the given one; None if there is none.
    A head that turns by a few degrees before the shot begins leaves hair near its skin, but moved along it by centimetres.
    """
    near = []
    for place, to_bind in enumerate(others):
        placed = transformed(roots, to_bind)
        middle = float(np.median(seat.skin.query(placed, NEAR)[0]))
        if middle <= seat.distance + UNSURE:  # faces take far longer to ask than points
            near.append(replace(seat, distance=middle, to_bind=to_bind, way=(True, place), roots=placed))
    if not near or (surface := seat.rig.surface) is None:
        return None
    off = _off_faces(surface.distance(seat.roots)[0])
    if off < UNEVEN:
        return None
    left = [_off_faces(surface.distance(each.roots)[0]) for each in near]
    return near[int(np.argmin(left))] if off >= SURELY * min(left) else None


def _on_skin_at_rest(rig: StageRig, roots: np.ndarray, at_rest: np.ndarray) -> Seat | None:
    """The seat of hair that was made in the rest pose, right on the skin that is nearest there; None if it is not."""
    placed = transformed(roots, at_rest)
    far = [float(np.median(skin.query(placed, NEAR)[0])) for skin in rig.skins]
    nearest = int(np.argmin(far))
    if not far[nearest] <= NEAR or rig.surface is None:
        return None
    signed = rig.surface.distance(placed)[0]
    if np.median(np.abs(signed)) > (ON_FACES if len(placed) >= MANY else UNEVEN) or _off_faces(signed) > UNEVEN:
        return None
    return Seat(far[nearest], rig, rig.meshes[nearest], at_rest, (True, 0), placed, rig.skins[nearest])


def _off_faces(signed: np.ndarray) -> float:
    """How far points at signed distances (n,) [m] are from lying on faces, or all at one distance from them, as hair that hovers."""
    middle = np.median(signed)
    return float(np.median(np.abs(signed - middle)) + HOVER * abs(middle))


def unsure(prim: Usd.Prim, seat: Seat, placement: Placement) -> list[str]:
    """The note on a groom that moves with neither skeleton nor head, if another of its likely places is on the skin, too."""
    drifts = drifts_of(seat.rig, placement)
    if moment(prim) is not None or min(drifts) <= STEADY:
        return []
    back = np.linalg.inv(seat.to_bind)
    places = [transformed(seat.roots, way @ back) for way in ways(seat.rig, seat.mesh, placement, drifts=drifts)]
    near = [roots for roots in places if np.median(seat.skin.query(roots)[0]) <= NEAR]
    apart = max((float(np.median(np.linalg.norm(roots - seat.roots, axis=1))) for roots in near), default=0.0)
    if apart < APART:
        return []
    return [
        f"{prim.GetPath()}: its motion is neither that of {seat.rig.path} nor of the head, so its place at rest is a guess, "
        f"maybe wrong by {1000 * apart:.2g} mm; bind it to the skeleton"
    ]


def kinship(prim: Usd.Prim, skeleton: Usd.Prim) -> int:
    """How many of their parents a groom and a skeleton share."""
    return prim.GetPath().GetCommonPrefix(skeleton.GetPath()).pathElementCount


def some_ends(prim: Usd.Prim, *, last: bool = False, beyond: Beyond | None = None) -> np.ndarray:
    """About SOME_ROOTS finite `ends` (n, 3) in the prim's own space.

    Raises:
        NeuralocksError: none is finite.
    """
    every = ends(prim, last=last, beyond=beyond)
    found = rest_points(prim)[every[:: max(1, len(every) // SOME_ROOTS)]]
    found = found[np.isfinite(found).all(axis=1)]
    if not len(found):
        raise NeuralocksError(f"{prim.GetPath()}: its points are not finite; repair the groom")
    return found


def some_places(rig: StageRig, placement: Placement) -> tuple[np.ndarray, np.ndarray]:
    """Some samples of a rig's clip (n,), and where a prim stands at each (n, 4, 4) [m]; without those at which it cannot be placed,
    for example because it is flat: a bake reports them when it gets there.
    """
    rows, places = [], []
    for row in np.unique(np.linspace(0, len(rig.time_codes) - 1, SOME_TIMES).astype(int)):
        with suppress(NeuralocksError):
            places.append(rig.border.to_core @ placement.at(rig.time_codes[row]))
            rows.append(row)
    return np.array(rows, int), np.array(places).reshape(-1, 4, 4)
