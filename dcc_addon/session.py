# SPDX-License-Identifier: GPL-3.0-or-later
"""Data that is computed once and kept in memory while Blender runs. Nothing here is saved; losing it costs only time.

Blender objects are looked up by name each time: a pointer kept over an undo or a file load is invalid.
"""

from __future__ import annotations

import traceback
from collections import deque
from collections.abc import Callable, Set
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import Clip

from .services.motion import Motion
from .services.rig import BodyArrays, RigArrays

if TYPE_CHECKING:
    from neuralocks_core.models.runtime import StrandModel

    from .kept import Bound, Followed, Key, Prepared, Stood, Written
    from .scene.character.armature import PoseReader
    from .scene.files.save_as import Remade
    from .services.threaded import Threaded


@dataclass(eq=False)
class SampledRig:
    """One armature with its sampled motion, as Blender and as the core see it."""

    rig: RigArrays
    motion: Motion
    character: Character
    clip: Clip
    trim: np.ndarray
    """See `services.motion.trim_of`."""
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
    """The setup that moves the rig; see `scene.motion.sampled_from.rigging_of`."""
    posture: int
    """The unkeyed pose; see `scene.motion.sampled_from.posture_of`."""
    unreported: dict[str, int]
    """Numbers of what Blender may not report of the bodies, by name; see `scene.motion.rigging.unreported`."""
    moved_by: frozenset[str]
    """Names of the objects that moved it; see `scene.motion.sampled_from.moved_by`."""
    carriers: dict[str, int]
    """Joints below the head that carry hair objects, by name: the jaw of a beard. All others ride on the head."""
    carried: dict[int, Character]
    """The character with each such joint, made once; see `carrying`."""
    body_arrays: tuple[BodyArrays, ...]
    """The body meshes as they were read then: a mirror object may stand elsewhere beside the body in another frame."""
    bodies_off: tuple[str, ...]
    """Notes on what hair is kept out of elsewhere than where it is drawn, or not at all; see `scene.character.body_drawn`, `scene.character.rigid_parts`."""
    leaps: tuple[str, ...]
    """Notes on frames at which the character jumps; see `services.leaps`."""
    hairs_off: dict[str, str]
    """Notes on hair objects, by name, that do not move with the head; see `scene.character.riding`."""

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


@dataclass(eq=False)
class Session:
    """Sampled rigs and prepared hair, by object name; messages for the panel."""

    rigs: dict[str, SampledRig] = field(default_factory=dict)
    hairs: dict[str, Prepared] = field(default_factory=dict)
    written: dict[str, Written] = field(default_factory=dict)
    """What the live view wrote to each hair object last; see `edited`."""
    followed: deque[Followed] = field(default_factory=lambda: deque(maxlen=8))
    """What was done to the points of live hair last; see `edited`."""
    stood: dict[object, Stood] = field(default_factory=dict)
    """How live hair objects stood when last written, by identity, also those that are gone; see `joined`."""
    preparing: dict[str, tuple[Threaded, Callable[[str], None]]] = field(default_factory=dict)
    """Hair objects that a thread is preparing, with what is called with the name when that is done."""
    chains: dict[str, Bound] = field(default_factory=dict)
    models: dict[str, tuple[tuple, StrandModel]] = field(default_factory=dict)
    weights: dict[str, tuple[tuple, np.ndarray]] = field(default_factory=dict)
    """Weights of body meshes, by mesh name; dropped when a mesh is edited."""
    grooms: dict[str, int] = field(default_factory=dict)
    """A number of the rest points of each groom that plays a cache, by the name of its Curves; dropped when these are edited."""
    examined: dict[str, tuple[tuple, tuple[RigArrays | None, int | None, str]]] = field(default_factory=dict)
    """What was found in armatures, by name, after what it was found by; see `scene.character.examined`."""
    bodies: dict[tuple, tuple] = field(default_factory=dict)
    """Numbers of the bodies of an armature in a scene; dropped when an edit may change them. See `scene.baked.body_known`."""
    surfaces: dict[str, tuple[set[str], int]] = field(default_factory=dict)
    """What animates the shape keys of each of these body meshes, and a number of it, by mesh name; dropped when it, or an action that it
    plays, is edited."""
    vertices: dict[str, int] = field(default_factory=dict)
    """A number of the vertices of each body mesh as they were read last, by mesh name."""
    messages: dict[str, str] = field(default_factory=dict)
    misrendered: dict[str, str] = field(default_factory=dict)
    """What the last render showed wrongly, by armature name, until the next one begins."""
    trained: tuple[str, bool] | None = None
    """How the last training ended, and whether that is good news."""
    trained_notes: list[str] = field(default_factory=list)
    """Further notes on it."""
    cards: dict[str, list[str]] = field(default_factory=dict)
    paused: int = 0
    """Above zero while frames are stepped for sampling: the live view then stays out of the way."""
    watched: set[str] = field(default_factory=set)
    """Objects that Blender evaluates although they are hidden; see `scene.drawing.watched`."""
    working: str = ""
    """Name of the operator that is at work over several slices."""
    sampling: float | None = None
    """Share of a sampling in the background that is done."""
    failed: set[str] = field(default_factory=set)
    """Armatures that could not be sampled in the background; tried again when they, a rest pose or an action change."""

    baked: dict[str, dict] = field(default_factory=dict)
    """What the caches on disk were last baked of, by path, whichever file is open; see `scene.baked.as_baked`."""
    files: int = 0
    """How many files were opened before the one that is open."""
    opened: dict[str, tuple[int, int]] = field(default_factory=dict)
    """First and last frame of each scene when its file was opened."""
    model_updated: set[str] = field(default_factory=set)
    """Live hair that another model moved when the file was saved; see `model_updates`."""
    edits: int = 0
    """How often animation was edited: what was sampled meanwhile is out of date."""
    switched: set[str] = field(default_factory=set)
    """Actions that Blender will report as edited, because some of their curves were muted; see `scene.hair.switches`."""
    wanting: bool = False
    """Whether live hair found its motion missing or out of date since this was last handled."""
    blurred: list[str] = field(default_factory=list)
    """Hair of a render that goes on after the current save, which takes `scene.hair.blur` off it."""
    remade: Remade | None = None
    """Paths that were rewritten for the current save; see `scene.files.save_as`."""
    doubtful: set[str] = field(default_factory=set)
    """Prepared hair whose groom or choices may have changed."""

    def doubt(self) -> None:
        """Anything in the file may have changed: look before use."""
        self.doubtful.update(self.hairs)
        self.written.clear()
        self.stop_preparing_all()
        self.weights.clear()
        self.grooms.clear()
        self.bodies.clear()
        self.surfaces.clear()
        self.chains.clear()

    def forget(self, name: str) -> None:
        """Drop what was prepared for a hair object or for the hair bones of an armature."""
        self.stop_preparing(name)
        self.hairs.pop(name, None)
        self.written.pop(name, None)
        self.chains.pop(name, None)
        self.messages.pop(name, None)

    def forget_motion(self, name: str, staying: Set[str] = frozenset()) -> None:
        """Drop an armature's sampled motion, and the hair that it carries except for that of the names `staying`."""
        sampled = self.rigs.pop(name, None)
        for hair in sampled.motion.places.keys() - staying if sampled is not None else ():
            self.stop_preparing(hair)
            self.hairs.pop(hair, None)
        self.failed.discard(name)
        self.chains.pop(name, None)
        self.messages.pop(name, None)

    def renew_motion(self, name: str, sampled: SampledRig) -> None:
        """Store an armature's sampled motion; hair prepared for the same character stays if the motion has it, and is checked before
        use.
        """
        before = self.rigs.get(name)
        same = before is not None and before.character is sampled.character
        staying = sampled.motion.places.keys() if same else frozenset()
        self.forget_motion(name, staying)
        self.doubtful.update(staying)
        self.rigs[name] = sampled

    def clear(self) -> None:
        """Forget everything, at file load and when the add-on is disabled; whoever is stepping frames must still end that."""
        self.stop_preparing_all()
        self.__init__(paused=self.paused, working=self.working, baked=self.baked, files=self.files + 1)

    def tell(self, name: str, error: Exception) -> None:
        """Say in the panel what went wrong with an object; what its user cannot fix is on the console as well."""
        if isinstance(error, (NeuralocksError, ReferenceError)):
            self.messages[name] = str(error)
        else:
            traceback.print_exception(error)
            self.messages[name] = f"{name}: unexpected {type(error).__name__}: {error}; see the console"

    def stop_preparing(self, name: str) -> None:
        """Cancel the thread that prepares a hair object, if there is one."""
        if name in self.preparing:
            self.preparing.pop(name)[0].cancel()

    def stop_preparing_all(self) -> None:
        """Cancel every thread that prepares hair."""
        for name in list(self.preparing):
            self.stop_preparing(name)


session = Session()
