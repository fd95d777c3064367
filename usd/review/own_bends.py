# SPDX-License-Identifier: Apache-2.0
"""Bending of strands that have fewer vertices than the network's, on their own vertices.

Between two of its vertices a displacement is linear, so all of a strand's change of bend would fall on the few network
vertices next to them: a circle of four vertices would store three times its real bend energy.
"""

import numpy as np

from neuralocks_core.evaluation.pose_energies import energies
from neuralocks_core.groom import Groom
from neuralocks_core.materials import Material
from neuralocks_core.models.network_sizes import K

DOUBLED = 0.01
"""A vertex within this share of a mean edge of the previous one is the same: its direction would be a rounding error."""


class OwnBends:
    """The coarse strands among those measured.

    Args:
        groom: as baked.
        strands: those measured (S,), each with at least two distinct points.
        arc: of the groom's points along their strands (P,) [m].
        rest: the groom's points (P, 3) [m] canonical.
        frames: how many there are.

    Attributes:
        fine: which of the strands (S,) are not coarse.
    """

    def __init__(self, groom: Groom, strands: np.ndarray, arc: np.ndarray, rest: np.ndarray, frames: int):
        self.fine = groom.counts[strands] >= K
        alike: dict[int, list[np.ndarray]] = {}
        for strand in strands[~self.fine]:
            start, count = int(groom.starts[strand]), int(groom.counts[strand])
            edges = np.diff(arc[start : start + count])
            kept = start + np.flatnonzero(np.append(True, edges > DOUBLED * edges.mean()))
            alike.setdefault(len(kept), []).append(kept)
        self._vertices = [np.stack(own) for own in alike.values()]
        self._rest = [rest[own] for own in self._vertices]
        self._moved = [np.zeros((frames, *own.shape, 3), np.float32) for own in self._vertices]

    def read(self, frame: int, offset: np.ndarray) -> None:
        """Take a frame's displacements (P, 3) [m] of the groom's points."""
        for moved, own in zip(self._moved, self._vertices, strict=True):
            moved[frame] = offset[own]

    def energy(self, moved: np.ndarray, rest: np.ndarray, material: Material) -> float:
        """Mean bend energy per unit mass [J/kg] of all strands, by `energies`.

        Args:
            moved: displacements (T, S, K, 3) [m] of the network's vertices, used for the strands that are not coarse.
            rest: the vertices at rest (S, K, 3) [m].
            material: what they are made of.
        """
        total, mass = 0.0, 0.0
        still = np.zeros((len(moved), 3))
        groups = [(moved[:, self.fine], rest[self.fine])] if self.fine.any() else []
        for offsets, points in (*groups, *zip(self._moved, self._rest, strict=True)):
            length = np.linalg.norm(np.diff(points, axis=1), axis=2).sum()
            total += length * energies(points + offsets, points, still, material)["bend"].mean()
            mass += length
        return float(total / mass)
