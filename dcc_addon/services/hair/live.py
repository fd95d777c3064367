# SPDX-License-Identifier: GPL-3.0-or-later
"""One hairstyle on one character, ready to compute its points at any time: what the live view draws."""

import numpy as np
from scipy.spatial import cKDTree

from neuralocks_core.boundary.history import BoundarySampler
from neuralocks_core.character import Character
from neuralocks_core.deformation.carrier import Carrier, Placing
from neuralocks_core.deformation.resolve import Resolver
from neuralocks_core.deformation.root_skin import ASTRAY, RootSkin
from neuralocks_core.deformation.strand_session import StrandSession
from neuralocks_core.groom import Groom
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.motion import Clip
from neuralocks_core.strands.strand_set import strands_on
from neuralocks_core.wind import Wind

from .history import SampledBoundary

SOME = 500
"""So many roots tell where all are."""


class LiveHair:
    """A groom bound to a character and a model; keeps no state from one frame to the next.

    Args:
        groom: strands in bind world space [m].
        character: whose head carries them.
        model: the network.
        say: called with the share that is done; an exception from it ends the work.

    Attributes:
        another_body: by which measure the character differs from those that the model has learned, "" where it does not.
        off_skin: how far the roots lie from the skin [m], in the median, where that is beyond `ASTRAY`; else 0.
    """

    def __init__(self, groom: Groom, character: Character, model: StrandModel, say=lambda done: None):
        self.character, self.model = character, model
        self.another_body, self.off_skin = "", _off_skin(groom, character)
        self._strands = strands_on(character, groom)
        say(0.4)
        self._carrier = Carrier(groom, self._strands)
        say(0.6)
        self._session = StrandSession(model, self._strands)
        say(1.0)
        self._resolver: Resolver | None = None
        self._skin: RootSkin | None = None
        self._sampler: BoundarySampler | None = None
        self._boundary: SampledBoundary | None = None
        self._clip: Clip | None = None
        self._points = np.empty((len(groom.points), 3), np.float32)
        self._shown: object = b""
        self._held = b""
        self._ends = np.concatenate([groom.starts, [len(groom.points)]])
        self._centre = character.canonical_to_bind[:3, 3]

    def follow(self, clip: Clip) -> None:
        """Read the body's history from this clip from now on."""
        if clip is not self._clip:
            if self._clip is None or not np.array_equal(clip.shape, self._clip.shape):
                self._skin = RootSkin(self.character, [self._strands], clip)
                self.another_body = self.model.another_body(self.character, clip)
            self._clip, self._sampler = clip, self.model.sampler(self.character, clip)
            self._boundary = SampledBoundary(self._sampler)
            self._held, self._shown = b"", b""
            if self._resolver is not None and not self._resolver.serves(clip):
                self._resolver = None

    def points(
        self,
        time: float,
        joints: np.ndarray,
        to_local: np.ndarray,
        material=(0.0,) * 4,
        strength: float = 1.0,
        wind: Wind | None = None,
        resolve: bool = False,
    ) -> np.ndarray:
        """Points of the groom at one time.

        Args:
            time: [s].
            joints: world transforms (J, 4, 4) of the pose that is drawn.
            to_local: transform (4, 4) from the core's world space to the space wanted.
            material: log-ratios (4,).
            strength: motion strength, 0 for a held pose.
            wind: in core axes; a model of held poses does not feel it.
            resolve: push hair out of the body.

        Returns:
            (P, 3) float32, valid until the next call.
        """
        vector = self._boundary.vector(time, material, strength, joints, wind if self.model.feels_wind else None)
        if self._held != (held := np.asarray(material).tobytes()):
            self._session.anchor(self._sampler.held_bind(material))
            self._held = held
        matrix = to_local @ self.character.carrying(joints)
        shape = self._clip.shape_at([time])[0]
        wanted = vector.tobytes(), matrix.tobytes(), shape.tobytes(), joints.tobytes() if resolve else b""
        if wanted == self._shown:
            return self._points
        self._shown = b""  # until the new frame is done
        placing = Placing.of(matrix, self._centre)

        def place(strands: slice, displacement: np.ndarray) -> None:
            out = self._points[self._ends[strands.start] : self._ends[strands.stop]]
            self._carrier.carry(displacement, out, strands, placing)

        resolve = resolve and self.character.body is not None
        if resolve or self._skin.moves:
            moved = self._moved(vector, joints, shape, resolve)
            self.model.by_chunk(lambda strands: place(strands, moved[strands]), len(moved))
        else:
            self._session.each(vector, place)
        self._shown = wanted
        return self._points

    def _moved(self, vector: np.ndarray, joints: np.ndarray, shape: np.ndarray, resolve: bool) -> np.ndarray:
        """Displacement (S, 24, 3) [m] of the network, on the skin that blend shapes move and pushed out of the body."""
        result = self._session.displacement(vector)
        if resolve and self._resolver is None:
            self._resolver = Resolver(self.character, self._skin.begun(self._strands), self._clip)

        def push(moved: np.ndarray) -> None:
            self._resolver.apply(moved, joints, shape, self.model.by_chunk)

        self._skin.carry(result, shape, push if resolve else None)
        return result


def _off_skin(groom: Groom, character: Character) -> float:
    if character.body is None or not len(groom.starts):
        return 0.0
    roots = groom.points[groom.starts[:: max(1, len(groom.starts) // SOME)]]
    far = float(np.median(cKDTree(character.body.points).query(roots)[0]))
    # A body may end at the neck.
    head = float(np.median(np.linalg.norm(roots - character.canonical_to_bind[:3, 3], axis=1)))
    return far if min(far, head) > ASTRAY * character.times_human else 0.0
