# SPDX-License-Identifier: Apache-2.0
"""One groom's points at any time code: a pure function of the shot and the model."""

from dataclasses import replace

import numpy as np

from neuralocks_core.deformation.resolve import Resolver
from neuralocks_core.deformation.strand_session import StrandSession
from neuralocks_core.materials import Material
from neuralocks_core.runtime import StrandModel, chunks
from neuralocks_core.strands.strand_set import StrandSet

from ..shot.stage import StageGroom
from .memory import LARGE, give_back, preparing
from .placing import GroomPlacer


class GroomPoser:
    """Deforms one groom of a shot with a model.

    Args:
        item: the groom.
        model: the strand model; its threads share the work, and the result does not depend on them.
        material: what the hair is made of.
        strength: motion strength; 0 is the held pose.
        resolve: push hair out of the body after the network.
        loop: the clip repeats, its last sample shows the pose of its first.
    """

    def __init__(
        self,
        item: StageGroom,
        model: StrandModel,
        material: Material | None = None,
        *,
        strength: float = 1.0,
        resolve: bool = False,
        loop: bool = False,
    ):
        self.item, self._rig, self._model = item, item.attachment.rig, model
        character = item.attachment.character
        self._material = (material or Material()).log_ratios()
        self._strength = strength
        self._sampler = model.sampler(character, replace(self._rig.clip, loop=True) if loop else self._rig.clip)
        self._resolver = None
        with preparing():  # or 150 MB of a large groom would stay allocated
            self._placer = GroomPlacer(item)
            self._session = StrandSession(model, self._placer.strands)
            self._session.anchor(self._sampler.held_bind(self._material))
            if resolve and character.body is not None:
                self._resolver = Resolver(character, self._placer.strands, self._rig.clip)
                self._resolver.prepare()

    @property
    def strands(self) -> StrandSet:
        """The groom as the network sees it."""
        return self._placer.strands

    def points(self, time_code: float) -> np.ndarray:
        """The groom's points (P, 3) float32 at a time code, in the prim's own space and units."""
        joints = self._rig.joints_at(time_code)
        if self._resolver is None:
            placed = self._placer.at(time_code, joints)
            self._session.each(self._vector(time_code, joints), placed.put)
            return placed.points
        moved = self._displacement(time_code, joints)
        # Each chunk's points take the place of its displacement where they are as many.
        placed = self._placer.at(time_code, joints, moved.reshape(-1, 3) if self._placer.same_size else None)
        for strands in chunks(len(moved)):
            placed.put(strands, moved[strands].copy())
        return placed.points

    def moved(self, time_code: float) -> np.ndarray:
        """Displacement (S, 24, 3) float32 [m] of the network's vertices, in canonical space."""
        return self._displacement(time_code, self._rig.joints_at(time_code))

    def _displacement(self, time_code: float, joints: np.ndarray) -> np.ndarray:
        moved = self._session.displacement(self._vector(time_code, joints))
        if self._resolver is not None:
            shape = self._rig.clip.shape_at(self._rig.border.seconds([time_code]))[0]
            self._resolver.apply(moved, joints, shape, self._model.map)
            if moved.nbytes > LARGE:
                give_back()  # 20 MB, for a few hundredths of the time: this frame will be written beside the next one
        return moved

    def _vector(self, time_code: float, joints: np.ndarray) -> np.ndarray:
        seconds = self._rig.border.seconds([time_code])
        return self._sampler.vectors(seconds, self._material, self._strength, joints[None])[0]
