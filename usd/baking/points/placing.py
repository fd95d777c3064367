# SPDX-License-Identifier: Apache-2.0
"""From a canonical displacement of 24 vertices to a groom's own points in its prim's space."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from neuralocks_core.character import Character
from neuralocks_core.deformation.carrier import Carrier, Placing
from neuralocks_core.groom import Groom
from neuralocks_core.rotation import inverse, sizes
from neuralocks_core.strands.locks import lock_of_roots
from neuralocks_core.strands.strand_set import StrandSet, strands_on

from ...shot.stage import StageGroom
from ...shot.strands.curves import rest_points
from .undrawn_points import UndrawnPoints

BLOCK = 512
"""Strands placed at a time, as many as the runtime infers at a time."""

PART = 32 * BLOCK
"""Strands prepared at a time, so that temporary memory does not grow with the groom."""

STILL = 1e-6
"""A groom moved by less than this [m] has not moved: its points are then written bit for bit."""


class GroomPlacer:
    """Places one groom of a shot; the result does not depend on the blocks in which it is asked for.

    Attributes:
        item: the groom.
        strands: as the network sees it.
        carriers: one for every PART strands.
        ends: (S + 1,) index of the first drawn point of each strand, and at the end the number of all.
        undrawn: moves the points that are not drawn, if there are any.
        same_size: whether every strand has as many points as the network gives it.
        centre: (3,) [m], the head's own place in bind world.
    """

    def __init__(self, item: StageGroom):
        self.item = item
        character = item.attachment.character
        self._parts = _parts(item.groom)
        self.strands = _strands(self._parts, character)
        slices = (slice(low, low + PART) for low in range(0, item.groom.strand_count, PART))
        self.carriers = [Carrier(part, self.strands.subset(s)) for part, s in zip(self._parts, slices, strict=True)]
        self.ends = np.concatenate([item.groom.starts, [len(item.groom.points)]])
        self.undrawn = None
        if item.beyond is not None:
            self.undrawn = UndrawnPoints(item.beyond, rest_points(item.prim), item.attachment.to_bind[:3, :3])
        self.same_size = self.undrawn is None and bool((item.groom.counts == self.strands.rest.shape[1]).all())
        self.centre = character.canonical_to_bind[:3, 3]
        low, high = item.groom.points.min(axis=0), item.groom.points.max(axis=0)
        self._corners = np.stack(np.meshgrid(*np.stack([low, high], axis=1)), axis=-1).reshape(-1, 3)

    def at(self, time_code: float, joints: np.ndarray, into: np.ndarray | None = None) -> "Placed":
        """The groom at a time code, to be filled in.

        Args:
            time_code: when.
            joints: (J, 4, 4) world joint transforms [m] at that time.
            into: array for the points, (P, 3) float32; made if left out.
        """
        item = self.item
        to_prim = inverse(item.attachment.rig.border.to_core @ item.placement.at(time_code))
        to_local = to_prim @ item.attachment.character.carrying(joints)
        points = np.empty((item.point_count, 3), np.float32) if into is None else into
        return Placed(self, to_local, self._rest_in_place(to_local), points)

    def points(self, time_code: float, joints: np.ndarray, displacement: Callable[[slice], np.ndarray]) -> np.ndarray:
        """Points (P, 3) float32 in the prim's own space and units.

        Args:
            time_code, joints: as for `at`.
            displacement: gives (n, 24, 3) float32 [m], canonical, for a slice of strands.
        """
        placed, count = self.at(time_code, joints), self.item.groom.strand_count
        for low in range(0, count, BLOCK):
            strands = slice(low, min(low + BLOCK, count))
            placed.put(strands, displacement(strands))
        return placed.points

    def _rest_in_place(self, to_local: np.ndarray) -> np.ndarray | None:
        """The authored rest points (P, 3) if the whole groom is at its rest place."""
        home = inverse(self.item.attachment.to_bind)
        shift = self._corners @ (to_local - home)[:3, :3].T + (to_local - home)[:3, 3]
        scale = abs(sizes(home))
        return rest_points(self.item.prim) if np.abs(shift).max() < STILL * scale else None


class Placed:
    """One groom at one time, filled block by block, by several threads if wanted.

    Attributes:
        points: (P, 3) float32 in the prim's own space and units.
    """

    def __init__(self, placer: GroomPlacer, to_local: np.ndarray, rest: np.ndarray | None, points: np.ndarray):
        self._placer, self._all_rest = placer, rest
        followed = rest is not None and placer.undrawn is not None
        self._rest = rest[placer.item.beyond.hair] if followed else rest
        self._linear = to_local[:3, :3]
        self._placing = Placing.of(to_local, placer.centre)
        self.points = points

    def put(self, strands: slice, displacement: np.ndarray) -> None:
        """Place consecutive strands of one PART.

        Args:
            strands: which.
            displacement: (n, 24, 3) float32 [m], canonical.
        """
        placer, part = self._placer, strands.start // PART
        here = slice(placer.ends[strands.start], placer.ends[strands.stop])
        within = slice(strands.start % PART, strands.start % PART + strands.stop - strands.start)
        onto = None if self._rest is None else self._rest[placer.ends[part * PART] :]
        undrawn = placer.undrawn
        out = self.points[here] if undrawn is None else np.empty((here.stop - here.start, 3), np.float32)
        placer.carriers[part].carry(displacement, out, within, self._placing, onto)
        if undrawn is not None:
            undrawn.put(out, here.start, self._linear, self._all_rest, self.points)


def _parts(groom: Groom) -> list[Groom]:
    """The groom cut into PART strands each; the points are not copied."""
    ends = np.append(groom.starts, len(groom.points))
    edges = [*range(0, groom.strand_count, PART), groom.strand_count]
    return [
        Groom(groom.name, groom.points[ends[low] : ends[high]], groom.counts[low:high])
        for low, high in zip(edges, edges[1:])
    ]


def _strands(parts: list[Groom], character: Character) -> StrandSet:
    """What `strands_on` gives for the whole groom, made part by part."""
    joined = StrandSet.joined([strands_on(character, part) for part in parts])
    return joined if len(parts) == 1 else replace(joined, lock=lock_of_roots(joined.rest[:, 0]))
