# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair bones: which bones they are, and their rotations at any time."""

import re
from dataclasses import dataclass, replace

import numpy as np

from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError, reworded
from neuralocks_core.motion import Clip
from neuralocks_core.rig import HairChains, RigModel, find_chains
from neuralocks_core.rig.carried import CarriedHair
from neuralocks_core.rig.measuring import placed_chains
from neuralocks_core.rotation import flat, rotation_part, to_quaternion
from neuralocks_core.wind import Wind

from ..rigs.hidden import NONE
from ..rigs.motion import Motion
from ..rigs.rig import RigArrays


def chains_of(rig: RigArrays, character: Character, wanted: str = "") -> HairChains:
    """The hair chains of a character.

    Args:
        rig: its armature.
        character: with its body, if that is known.
        wanted: names of first bones, separated by commas; if empty, chains are found automatically.

    Raises:
        NeuralocksError: there are none, or one of them cannot be measured.
    """
    meshes = None if character.body is None else [character.body]
    try:
        return find_chains(character, meshes, rig.patterns(wanted) or None)
    except NeuralocksError as error:
        # Joints that the patterns became are not what the artist wrote.
        text = re.sub("--chains [^:]*:", lambda _: f"--chains {wanted}:", str(error), count=1)
        raise reworded(error, rig.said(text.replace("skeleton:", f"{rig.name}:", 1))) from None


def own_turns(own: np.ndarray, motion: Motion, joints: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Rotations (T, N, 4) wxyz that the bones' own channels gave joints (N,) at frames (T,), in their own rest axes; `own` as
    in `SampledRig`. Flat bones have none.
    """
    linear = own[[motion.row(frame) for frame in frames]][:, joints]
    turned = np.where(flat(linear, NONE)[..., None, None], np.eye(3), linear)
    return to_quaternion(rotation_part(turned, "hair bones"))


@dataclass(eq=False)
class LiveBones:
    """A rig model bound to a character.

    Attributes:
        model: the rig model.
        bones: names of the hair bones, (N), as in Blender.
        chains: this rig's, with every joint of the model's chains; their joints (N,) are the hair bones.
    """

    model: RigModel
    bones: tuple[str, ...]
    chains: HairChains
    _clip: Clip | None = None

    @classmethod
    def of(cls, model: RigModel, rig: RigArrays, character: Character) -> "LiveBones":
        """Bind a model; the error says why it does not fit this rig."""
        try:
            model = replace(model, chains=model.chains.named_as(rig.paths, character.of_head))
            chains = placed_chains(model.chains, character)
            model.chains.check_same(chains)
        except NeuralocksError as error:
            raise reworded(error, rig.said(str(error))) from None
        return cls(model, tuple(rig.bones[j] for j in chains.joints), chains)

    def follow(self, character: Character, clip: Clip) -> None:
        """Read the body's history from this clip from now on."""
        if self._clip is not clip:
            self._clip, self._carried = clip, CarriedHair(self.model, self.chains.joints, character, clip)

    def turns(
        self, times, strength: float = 1.0, joints: np.ndarray | None = None, wind: Wind | None = None
    ) -> np.ndarray:
        """Rotations (T, N, 4) wxyz of the hair bones in their own rest axes, at times (T,) [s]; joints (T, J, 4, 4) are the drawn
        poses. A model of held poses does not feel the wind.
        """
        felt = wind if self.model.feels_wind else None
        return self.model.chains.turns_on(self.chains, self._carried.turns(times, strength, joints, felt))
