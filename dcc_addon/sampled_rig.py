# SPDX-License-Identifier: GPL-3.0-or-later
"""An armature with its sampled motion, from which live hair is posed and bakes are made."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from neuralocks_core.character import Character
from neuralocks_core.motion import Clip

from .services.rigs.motion import Motion
from .services.rigs.rig import BodyArrays, RigArrays

if TYPE_CHECKING:
    from .live_state import Key
    from .scene.character.armature import PoseReader


@dataclass(eq=False)
class SampledRig:
    """One armature with its sampled motion, as Blender and as the core see it."""

    rig: RigArrays
    motion: Motion
    character: Character
    clip: Clip
    trim: np.ndarray
    """See `services.rigs.motion.trim_of`."""
    reader: PoseReader
    """Reads its pose anew."""
    key: Key
    """What the sampling depended on besides the animation."""
    bind_places: dict[str, np.ndarray]
    """World transforms (4, 4) of hair and bodies in the bind pose, by name."""
    stale: bool
    """Whether the animation has changed since."""
    bind_metres: float
    """Metres of one unit of the bind pose: the scene's unit scale, times the size at which the motion shows the head."""
    drawn: np.ndarray
    """Joints (T, J, 4, 4) in Blender's world space as Blender gave them, before conversion to channels, float32."""
    own: np.ndarray
    """Rotation and scale from the bones' own channels, without constraints, (T, J, 3, 3) float32."""
    rigging: int
    """The setup that moves the rig; see `scene.motion.dependencies.rigging_of`."""
    posture: int
    """The unkeyed pose; see `scene.motion.dependencies.posture_of`."""
    unreported: dict[str, int]
    """Numbers of what Blender may not report of the bodies, by name; see `scene.motion.rigging.unreported`."""
    moved_by: frozenset[str]
    """Names of the objects that moved it; see `scene.motion.dependencies.moved_by`."""
    carriers: dict[str, int]
    """Joints below the head that carry hair objects, by name: the jaw of a beard. All others ride on the head."""
    carried: dict[int, Character]
    """The character with each such joint, made once; see `carrying`."""
    body_arrays: tuple[BodyArrays, ...]
    """The body meshes as they were read then: a mirror object may stand elsewhere beside the body in another frame."""
    bodies_off: tuple[str, ...]
    """Notes on what hair is kept out of elsewhere than where it is drawn, or not at all; see `scene.character.body_drawn`, `scene.character.rigid_parts`."""
    leaps: tuple[str, ...]
    """Notes on frames at which the character jumps; see `services.rigs.leaps`."""
    hairs_off: dict[str, str]
    """Notes on hair objects, by name, that do not move with the head; see `scene.character.riding`."""
    actions: dict[str, int] | None = None
    """Numbers of the actions that moved it, by name, once an undo has asked for them; see `scene.motion.after_undo`."""

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the body meshes."""
        return self.key.bodies

    def carrying(self, hair: str) -> Character:
        """The character as it carries a hair object: the identical object as long as it stays the same."""
        joint = self.carriers.get(hair)
        if joint is None:
            return self.character
        return self.carried.setdefault(joint, replace(self.character, carrier=joint))

    @cached_property
    def moving(self) -> tuple[np.ndarray, np.ndarray]:
        """Joints (N,) by which hair is moved; and these with all that move the body, which hair may be kept out of."""
        hair = np.unique([*self.character.humanoid.values(), *self.carriers.values()])
        body = self.character.body
        return hair, hair if body is None else np.union1d(hair, body.joint_indices[body.joint_weights > 0])
