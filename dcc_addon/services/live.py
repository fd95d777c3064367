# SPDX-License-Identifier: GPL-3.0-or-later
"""One hairstyle on one character, ready to give its points at any time: what the live view draws."""

import numpy as np

from neuralocks_core.boundary import BoundarySampler
from neuralocks_core.character import Character
from neuralocks_core.groom import Groom
from neuralocks_core.motion import Clip
from neuralocks_core.runtime import StrandModel
from neuralocks_core.strands import Carrier, strand_set


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
        self._bind = np.empty((len(groom.points), 3), np.float32)
        self._world = np.empty_like(self._bind)
        self._displacement = np.empty((len(strands.rest), strands.rest.shape[1], 3), np.float32)

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
        displacement = self._session.displacement(vector, out=self._displacement)
        self._carrier.carry(displacement, self._bind)
        matrix = to_local @ self.character.carrying(joints)
        np.matmul(self._bind, matrix[:3, :3].T.astype(np.float32), out=self._world)
        self._world += matrix[:3, 3].astype(np.float32)
        return self._world
