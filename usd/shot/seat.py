# SPDX-License-Identifier: Apache-2.0
"""Where curves without a binding lie in a rig's bind pose, and on which skin.

A file does not say what the transform of such curves refers to: the bind pose, a skin elsewhere in the stage, or the pose
at one moment. For curves that move with the head or are a moving cache it is a moment; for the rest, it is whichever puts
their roots on skin.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from pxr import Usd

from neuralocks_core.body.collider import Collider
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import transformed

from ..border.placement import Placement
from ..skel.skin import Skin
from ..skel.stage_rig import StageRig
from ..skel.surface import StageMesh
from .curve_ends import Beyond, beyond_ends, ends
from .curves import lone_sample, moment, rest_points

NEAR = 0.03
"""Roots this far from a mesh, in the median, still sit on it [m]."""
CLEARLY = 2
"""Hair must be this many times nearer to skin by a less likely way than by a likelier one for the former to count: hair that hovers
over skin may come a little nearer by a wrong way, such as one that counts a parent's scale twice.
"""
SURELY = ((3e-3, 4), (1e-3, 12))
"""Roots that a likely way puts near skin, but the former [m] or more from its faces in the median, are taken by another way if that
brings them this many times nearer to faces."""
SOME_ROOTS, SOME_TIMES = 1000, 16
"""About how many of a groom's roots and of a prim's samples are looked at: all would be too many."""

STEADY = 1e-4
"""A prim that drifts no more than this relative to something is moved by it."""
ABOUT, ROUNDED = 10.0, 0.01
"""A drift is a share of the prim's distance from the origin, but of at most ABOUT metres or, since far positions are rounded, of
ROUNDED times that distance."""
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
    drifts = None if when is not None or not rig.meshes else _drifts(rig, placement)  # the same for all meshes

    def nearest(best: Seat | None, mesh, skin, way: tuple[bool, int], to_bind) -> Seat | None:
        placed = transformed(roots, to_bind)
        # In a crowd nearly all skins are far, and finding the nearest point of a far one takes a hundred times as long as finding
        # that none is near. Twice the bound, because what is nearer by another way must be CLEARLY nearer.
        middle = float(np.median(skin.query(placed, CLEARLY * within)[0]))
        clear = CLEARLY if best is not None and way > best.way else 1
        better = np.isfinite(middle) and (best is None or clear * middle < best.distance - 1e-4)
        return Seat(middle, rig, mesh, to_bind, way, placed, skin) if better else best

    for likely in (True, False):
        if best is not None and best.distance <= NEAR:
            break
        for mesh, skin in zip(rig.meshes, rig.skins, strict=True):
            for place, to_bind in enumerate(ways(rig, mesh, placement, when, likely=likely, drifts=drifts)):
                best = nearest(best, mesh, skin, (not likely, place), to_bind)
    if best is not None and best.distance <= NEAR:
        return _on_faces(best, roots, when, placement, drifts) or best
    return best if best is not None and best.distance <= within else None


def _on_faces(seat: Seat, roots: np.ndarray, when: float | None, placement: Placement, drifts) -> Seat | None:
    """The seat by an unlikely way that puts roots right onto the skin, near which they only are by the given one; None if there is
    none. A head that turns by a few degrees before the shot begins leaves hair near its skin, but moved along it by centimetres.
    """
    near = []
    for place, to_bind in enumerate(ways(seat.rig, seat.mesh, placement, when, likely=False, drifts=drifts)):
        placed = transformed(roots, to_bind)
        middle = float(np.median(seat.skin.query(placed, seat.distance)[0]))
        if np.isfinite(middle):
            near.append(replace(seat, distance=middle, to_bind=to_bind, way=(True, place), roots=placed))
    if not near or (surface := seat.rig.surface) is None or (off := _median_off(surface, seat.roots)) < SURELY[-1][0]:
        return None
    best = min(near, key=lambda each: _median_off(surface, each.roots))
    left = _median_off(surface, best.roots)
    return best if any(off >= max(least, times * left) for least, times in SURELY) else None


def _median_off(surface: Collider, points: np.ndarray) -> float:
    """Median distance of points (n, 3) from faces, on either side [m]."""
    return float(np.median(np.abs(surface.distance(points)[0])))


def ways(
    rig: StageRig,
    mesh: StageMesh | None,
    placement: Placement,
    when: float | None = None,
    *,
    likely: bool = True,
    drifts: tuple[float, float] | None = None,
) -> list[np.ndarray]:
    """Candidates (4, 4) for the way from the groom's own space to bind world, the likeliest first.

    Args:
        rig: what carries the groom.
        mesh: its skin below the groom, if it has one.
        placement: where the groom's prim stands.
        when: time code at which the groom has the points it is read with, if they are not points at rest.
        likely: those that serve unless skin says otherwise, or the others.
        drifts: the result of `_drifts`, if it is known already.
    """
    groom = placement.reference
    still = []
    if mesh is not None and mesh.placement.usable:
        still.append(rig.to_bind @ mesh.geom_bind @ np.linalg.inv(mesh.placement.reference) @ groom)
    still += [rig.to_bind @ np.linalg.inv(rig.source.placement.reference) @ groom, rig.to_bind @ groom]
    if placement.brought is not None:  # another file's groom knows nothing of where the character's file puts it
        still.append(rig.border.to_core @ groom)
    if not rig.source.animated:
        return still if likely else []
    if when is not None:  # it is seen where it is then
        return [_posed(rig, placement, when)] if likely else still
    with_skeleton, with_head = drifts or _drifts(rig, placement)
    if with_skeleton <= STEADY:
        return still if likely else _elsewhere(rig, placement)
    # A prim that is moved along by its parents: where it stood relative to the head when that motion began.
    posed = [_posed(rig, placement, placement.samples[0])]
    if with_head <= STEADY:
        return posed if likely else still
    # A set carries along what stands and walks in it; only what nearly keeps to the head was made on it.
    both = posed + still if CLEARLY * with_head < with_skeleton else still + posed
    return both if likely else []


def unsure(prim: Usd.Prim, seat: Seat, placement: Placement) -> list[str]:
    """The note on a groom that moves with neither skeleton nor head, if another of its likely places is on the skin, too."""
    drifts = _drifts(seat.rig, placement)
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


def _elsewhere(rig: StageRig, placement: Placement) -> list[np.ndarray]:
    """Ways of hair that stands still, made on a head that is not in the bind pose: when its exporter wrote it, when the motion or
    the shot begins, or in the rest pose, which USD shows of a character without its animation.
    """
    codes = dict.fromkeys([*lone_sample(placement.prim), *placement.lone_samples, *beginnings(rig)])
    at_rest = np.linalg.inv(rig.carrying_at_rest) @ rig.border.to_core @ placement.reference
    return [*(_posed(rig, placement, code) for code in codes), at_rest]


def beginnings(rig: StageRig) -> list[float]:
    """Time codes at which the motion begins, and the shot begins, if that is after a run-up."""
    (first, last), stage = rig.time_codes[[0, -1]].tolist(), rig.source.prim.GetStage()
    start = stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else first
    return [first, start] if first < start <= last else [first]


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


def _posed(rig: StageRig, placement: Placement, when: float) -> np.ndarray:
    """The way of a groom that lies right on the head as it is at a time code."""
    return np.linalg.inv(rig.carrying_at(when)) @ rig.border.to_core @ placement.at(when)


def _drifts(rig: StageRig, placement: Placement) -> tuple[float, float]:
    """How much a prim moves relative to a skeleton, and to its head; (0, 0) if either stands still, infinity for the head if the
    skeleton's place moves the prim.
    """
    if not placement.samples or not rig.source.animated:
        return 0.0, 0.0
    about = ABOUT / rig.border.metres_per_unit
    with_skeleton = _drift(placement, rig.source.placement.at, about)
    if with_skeleton <= STEADY:
        return with_skeleton, np.inf
    return with_skeleton, _drift(
        placement, lambda time: rig.border.from_core @ rig.carrying_at(time) @ rig.border.to_core, about
    )


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


def _drift(placement: Placement, against: Callable[[float], np.ndarray], about: float) -> float:
    """How much a moving prim moves relative to something else in stage space, as a share: 0 if that is what moves it; `about` is
    ABOUT in units of the stage.
    """
    times = placement.samples[:: max(1, len(placement.samples) // SOME_TIMES)]
    places = np.stack([placement.at(time) for time in times])
    relative = np.linalg.inv(np.stack([against(time) for time in times])) @ places
    turned, moved = (np.abs(relative - relative[0])[..., part].max() for part in (slice(3), 3))
    far = np.abs(places[..., 3]).max()
    reach = max(1.0, min(far, about), ROUNDED * far, np.abs(relative[..., 3]).max())
    return float(max(turned / np.abs(relative[0, :3, :3]).max(), moved / reach))
