# SPDX-License-Identifier: GPL-3.0-or-later
"""One hairstyle on one character, ready to give its points at any time: what the live view draws."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from neuralocks_core.boundary import BoundarySampler
from neuralocks_core.carrier import Carrier
from neuralocks_core.character import Character
from neuralocks_core.groom import Groom
from neuralocks_core.motion import Clip
from neuralocks_core.runtime import StrandModel
from neuralocks_core.strands import strand_set

BLOCK_POINTS = 24_576
"""Points worked on at a time: they stay in a core's cache, and a product of so few rows by a 3x3 matrix stays on its
core instead of waking BLAS threads that wait for each other."""
CHUNK = 512
"""Strands that the runtime takes at a time; blocks are made of whole ones."""


class LiveHair:
    """A groom bound to a character and a model; keeps no state from one frame to the next.

    Args:
        groom: strands in bind world space [m].
        character: whose head carries them.
        model: the network.
    """

    def __init__(self, groom: Groom, character: Character, model: StrandModel):
        self.groom, self.character, self.model = groom, character, model
        origin = character.skeleton.bind[character.head, :3, 3]
        strands = strand_set(groom, origin, character.head_centre, character.facing)
        self._carrier = Carrier(groom, strands)
        self._session = model.prepare(strands)
        self._sampler: BoundarySampler | None = None
        self._clip: Clip | None = None
        self._points = np.empty((len(groom.points), 3), np.float32)
        count = groom.strand_count
        step = CHUNK * max(1, int(BLOCK_POINTS / max(len(groom.points) / count, 1)) // CHUNK)
        self._blocks = [slice(low, min(low + step, count)) for low in range(0, count, step)]
        self._ends = np.concatenate([groom.starts, [len(groom.points)]])
        self._pool = ThreadPoolExecutor(model.threads, thread_name_prefix="live")

    def follow(self, clip: Clip) -> None:
        """Read the body's history from this clip from now on."""
        if clip is not self._clip:
            self._clip, self._sampler = clip, self.model.sampler(self.character, clip)

    def points(
        self, time: float, joints: np.ndarray, to_local: np.ndarray, material=(0.0,) * 4, strength: float = 1.0
    ) -> np.ndarray:
        """Points of the groom at one time.

        Args:
            time: [s].
            joints: world transforms (J, 4, 4) of the pose that is drawn.
            to_local: transform (4, 4) from the core's world space to the space wanted.
            material: log-ratios (4,).
            strength: motion strength, 0 for a held pose.

        Returns:
            (P, 3) float32, valid until the next call.
        """
        vector = self._sampler.vectors([time], material, strength, joints[None])[0]
        self._session.anchor(self._sampler.held_bind(material))
        matrix = to_local @ self.character.carrying(joints)
        linear = np.ascontiguousarray(matrix[:3, :3].T, np.float32)
        # From the head's own place, so that coordinates far from the origin cost no digits.
        centre = self.character.canonical_to_bind[:3, 3].astype(np.float32)
        origin = (matrix[:3, :3] @ centre.astype(float) + matrix[:3, 3]).astype(np.float32)

        def work(strands: slice) -> None:
            out = self._points[self._ends[strands.start] : self._ends[strands.stop]]
            self._carrier.carry(self._session.displacement(vector, strands), out, strands)
            out -= centre
            np.matmul(out, linear, out=out)
            out += origin

        if len(self._blocks) == 1:
            work(self._blocks[0])
        else:
            for _ in self._pool.map(work, self._blocks):
                pass
        return self._points
