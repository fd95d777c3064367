# SPDX-License-Identifier: Apache-2.0
"""From a canonical displacement of 24 vertices to a groom's own points in its prim's space."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from neuralocks_core.carrier import Carrier
from neuralocks_core.character import Character
from neuralocks_core.groom import Groom
from neuralocks_core.locks import lock_of_roots
from neuralocks_core.strands import StrandSet, strand_set

from .curves import rest_points
from .stage import StageGroom

BLOCK = 4096
"""Strands that one thread takes at a time; a multiple of what the runtime takes."""

PART = 4 * BLOCK
"""Strands prepared at a time: what that needs besides its result does not grow with the groom."""

STILL = 1e-6
"""A groom moved by less than this [m] has not moved: its points are then written bit for bit."""


class GroomPlacer:
    """Places one groom of a shot; the result depends on neither the threads nor the blocks.

    Attributes:
        item: the groom.
        strands: as the network sees it.

    Args:
        item: the groom.
        jobs: threads.
    """

    def __init__(self, item: StageGroom, jobs: int = 1):
        self.item = item
        character = item.attachment.character
        self._parts = _parts(item.groom)
        self.strands = _strands(self._parts, character)
        slices = (slice(low, low + PART) for low in range(0, item.groom.strand_count, PART))
        self._carriers = [Carrier(part, self.strands.subset(s)) for part, s in zip(self._parts, slices, strict=True)]
        self._pool = ThreadPoolExecutor(max(1, jobs), thread_name_prefix="place")
        self._ends = np.concatenate([item.groom.starts, [len(item.groom.points)]])
        self._centre = character.canonical_to_bind[:3, 3].astype(np.float32)
        low, high = item.groom.points.min(axis=0), item.groom.points.max(axis=0)
        self._corners = np.stack(np.meshgrid(*np.stack([low, high], axis=1)), axis=-1).reshape(-1, 3)

    def close(self) -> None:
        """Let the threads go."""
        self._pool.shutdown()

    def points(self, time_code: float, joints: np.ndarray, displacement: Callable[[slice], np.ndarray]) -> np.ndarray:
        """Points (P, 3) float32 in the prim's own space and units.

        Args:
            time_code: when.
            joints: world joint transforms (J, 4, 4) [m] at that time.
            displacement: gives (n, 24, 3) float32 [m], canonical, for a slice of strands.
        """
        item, groom = self.item, self.item.groom
        to_prim = np.linalg.inv(item.attachment.rig.border.to_core @ item.placement.at(time_code))
        to_local = to_prim @ item.attachment.character.carrying(joints)
        rest = self._rest_in_place(to_local)
        linear = to_local[:3, :3].astype(np.float32)
        origin = (to_local[:3, :3] @ self._centre.astype(float) + to_local[:3, 3]).astype(np.float32)
        result = np.empty((len(groom.points), 3), np.float32)

        def block(strands: slice) -> None:
            here = slice(self._ends[strands.start], self._ends[strands.stop])
            within = slice(strands.start % PART, strands.start % PART + strands.stop - strands.start)
            carrier = self._carriers[strands.start // PART]
            out = carrier.carry(displacement(strands), out=result[here], strands=within)
            if rest is not None:
                # What the network did not move keeps the author's own bits.
                out -= groom.points[here]
                out[:] = rest[here] + out @ linear.T
            else:
                out -= self._centre
                out[:] = out @ linear.T + origin

        count = groom.strand_count
        for _ in self._pool.map(block, [slice(low, min(low + BLOCK, count)) for low in range(0, count, BLOCK)]):
            pass
        return result

    def _rest_in_place(self, to_local: np.ndarray) -> np.ndarray | None:
        """The authored rest points (P, 3) if the groom as a whole stands where it rests."""
        home = np.linalg.inv(self.item.attachment.to_bind)
        shift = self._corners @ (to_local - home)[:3, :3].T + (to_local - home)[:3, 3]
        scale = np.cbrt(abs(np.linalg.det(home[:3, :3])))
        return rest_points(self.item.prim) if np.abs(shift).max() < STILL * scale else None


def _parts(groom: Groom) -> list[Groom]:
    """The groom cut into PART strands each; the points are not copied."""
    ends = np.append(groom.starts, len(groom.points))
    edges = [*range(0, groom.strand_count, PART), groom.strand_count]
    return [
        Groom(groom.name, groom.points[ends[low] : ends[high]], groom.counts[low:high])
        for low, high in zip(edges, edges[1:])
    ]


def _strands(parts: list[Groom], character: Character) -> StrandSet:
    """What `strand_set` gives for the whole groom, made part by part."""
    place = character.canonical_to_bind[:3, 3], character.head_centre, character.facing
    if len(parts) == 1:
        return strand_set(parts[0], *place)
    sets = [strand_set(part, *place, locks=1) for part in parts]
    fields = ("rest", "valid", "uv", "root_frame", "length")
    joined = {name: np.concatenate([getattr(each, name) for each in sets]) for name in fields}
    return replace(sets[0], lock=lock_of_roots(joined["rest"][:, 0]), **joined)
