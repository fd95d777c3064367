# SPDX-License-Identifier: Apache-2.0
"""One groom's points at any time code: a pure function of the shot and the model."""

from dataclasses import replace

import numpy as np

from neuralocks_core.materials import Material
from neuralocks_core.runtime import StrandModel

from .memory import give_back
from .placing import GroomPlacer
from .stage import StageGroom


class GroomPoser:
    """Deforms one groom of a shot with a model.

    Args:
        item: the groom.
        model: the strand model.
        material: what the hair is made of.
        strength: motion strength; 0 is the held pose.
        resolve: push hair out of the body after the network.
        loop: the clip's last sample is followed by its first.
        jobs: threads; the result does not depend on it.
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
        jobs: int = 1,
    ):
        self.item, self._rig = item, item.attachment.rig
        character = item.attachment.character
        self._placer = GroomPlacer(item, jobs)
        self._material = (material or Material()).log_ratios()
        self._strength = strength
        self._sampler = model.sampler(character, replace(self._rig.clip, loop=True) if loop else self._rig.clip)
        self._session = model.prepare(self._placer.strands)
        self._session.anchor(self._sampler.held_bind(self._material))
        self._session.codes = None  # needed for the first layer only; 15 MB of a large groom
        self._resolver = None
        if resolve and character.body is not None:
            from neuralocks_core.resolve import Resolver

            self._resolver = Resolver(character, self._placer.strands)
        give_back()  # 60 MB of a large groom

    def close(self) -> None:
        """Let the threads go."""
        self._placer.close()

    def __enter__(self) -> "GroomPoser":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def points(self, time_code: float) -> np.ndarray:
        """The groom's points (P, 3) float32 at a time code, in the prim's own space and units."""
        joints = self._rig.joints_at(time_code)
        seconds = self._rig.border.seconds([time_code])
        vector = self._sampler.vectors(seconds, self._material, self._strength, joints[None])[0]
        if self._resolver is None:
            return self._placer.points(time_code, joints, lambda strands: self._session.displacement(vector, strands))
        shape = self._rig.clip.shape_at(seconds)[0]
        whole = self._resolver.displacement(self._session.displacement(vector), joints, shape)
        return self._placer.points(time_code, joints, lambda strands: whole[strands])
