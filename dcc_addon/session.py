# SPDX-License-Identifier: GPL-3.0-or-later
"""Data that is computed once and kept in memory while Blender runs. Nothing here is saved; losing it costs only time.

Blender objects are looked up by name each time: a pointer kept over an undo or a file load is invalid.
"""

from __future__ import annotations

import traceback
from collections import deque
from collections.abc import Callable, Set
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from neuralocks_core.errors import NeuralocksError

from .services.rigs.rig import RigArrays

if TYPE_CHECKING:
    from neuralocks_core.models.runtime import StrandModel

    from .live_state import Bound, Followed, Prepared, Stood, Written
    from .sampled_rig import SampledRig
    from .scene.files.save_as import Remade
    from .services.work.threaded import Threaded


@dataclass(eq=False)
class Session:
    """Sampled rigs and prepared hair, by object name, and what else is known of the file that is open."""

    rigs: dict[str, SampledRig] = field(default_factory=dict)
    hairs: dict[str, Prepared] = field(default_factory=dict)
    doubtful: set[str] = field(default_factory=set)
    """Prepared hair whose groom or choices may have changed."""
    preparing: dict[str, tuple[Threaded, Callable[[str], None]]] = field(default_factory=dict)
    """Hair objects that a thread is preparing, with what is called with the name when that is done."""
    chains: dict[str, Bound] = field(default_factory=dict)
    models: dict[str, tuple[tuple, StrandModel]] = field(default_factory=dict)
    read: Read = field(default_factory=lambda: Read())
    shown: Shown = field(default_factory=lambda: Shown())
    said: Said = field(default_factory=lambda: Said())
    sampling: Sampling = field(default_factory=lambda: Sampling())
    saving: Saving = field(default_factory=lambda: Saving())
    edits: int = 0
    """How often animation was edited: what was sampled meanwhile is out of date."""
    switched: set[str] = field(default_factory=set)
    """Actions that Blender will report as edited, because some of their curves were muted; see `scene.hair.switches`."""
    renewed: bool = False
    """Whether a file was opened, or an undo done, since Blender last reported edits: it then reports everything as edited."""
    watched: set[str] = field(default_factory=set)
    """Objects that Blender evaluates although they are hidden; see `scene.drawing.hidden_objects`."""
    opened: dict[str, tuple[int, int]] = field(default_factory=dict)
    """First and last frame of each scene when its file was opened."""
    model_updated: set[str] = field(default_factory=set)
    """Live hair that another model moved when the file was saved; see `model_updates`."""

    paused: int = 0
    """Above zero while frames are stepped for sampling: the live view then stays out of the way."""
    working: str = ""
    """Name of the operator that is at work over several slices."""
    files: int = 0
    """How many files were opened before the one that is open."""
    baked: dict[str, dict] = field(default_factory=dict)
    """What the caches on disk were last baked of, by path, whichever file is open; see `scene.baked.motion_record`."""

    def doubt(self) -> None:
        """Anything in the file may have changed: look before use."""
        self.doubtful.update(self.hairs)
        self.shown.written.clear()
        self.stop_preparing_all()
        self.read.doubt()
        self.chains.clear()

    def forget(self, name: str) -> None:
        """Drop what was prepared for a hair object or for the hair bones of an armature."""
        self.stop_preparing(name)
        self.hairs.pop(name, None)
        self.shown.written.pop(name, None)
        self.chains.pop(name, None)
        self.said.messages.pop(name, None)

    def forget_motion(self, name: str, staying: Set[str] = frozenset()) -> None:
        """Drop an armature's sampled motion, and the hair that it carries except for that of the names `staying`."""
        sampled = self.rigs.pop(name, None)
        for hair in sampled.motion.places.keys() - staying if sampled is not None else ():
            self.stop_preparing(hair)
            self.hairs.pop(hair, None)
        self.sampling.failed.discard(name)
        self.chains.pop(name, None)
        self.said.messages.pop(name, None)

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

    def stop_preparing(self, name: str) -> None:
        """Cancel the thread that prepares a hair object, if there is one."""
        if name in self.preparing:
            self.preparing.pop(name)[0].cancel()

    def stop_preparing_all(self) -> None:
        """Cancel every thread that prepares hair."""
        for name in list(self.preparing):
            self.stop_preparing(name)


@dataclass(eq=False)
class Read:
    """What was read of data in the file, or numbers of it, by name."""

    weights: dict[str, tuple[tuple, np.ndarray]] = field(default_factory=dict)
    """Weights of body meshes, by mesh name; dropped when a mesh is edited."""
    edited: set[str] = field(default_factory=set)
    """Meshes that were edited since the file was opened: an undo can only change these."""
    grooms: dict[str, int] = field(default_factory=dict)
    """A number of the rest points of each groom that plays a cache, by the name of its Curves; dropped when these are edited."""
    bodies: dict[tuple, tuple] = field(default_factory=dict)
    """Numbers of the bodies of an armature in a scene; dropped when an edit may change them. See `scene.baked.body_record`."""
    surfaces: dict[str, tuple[set[str], int]] = field(default_factory=dict)
    """What animates the shape keys of each of these body meshes, and a number of it, by mesh name; dropped when it, or an action that it
    plays, is edited."""
    vertices: dict[str, int] = field(default_factory=dict)
    """A number of the vertices of each body mesh as they were read last, by mesh name, to compare with."""
    examined: dict[str, tuple[tuple, tuple[RigArrays | None, int | None, str]]] = field(default_factory=dict)
    """What was found in armatures, by name, after what it was found by; see `scene.character.examined`."""

    def doubt(self) -> None:
        """Drop all that is not compared with the file before use."""
        for each in (self.weights, self.grooms, self.bodies, self.surfaces):
            each.clear()


@dataclass(eq=False)
class Shown:
    """What the live view did to hair objects, to tell what others do to them."""

    written: dict[str, Written] = field(default_factory=dict)
    """What was written to each hair object last; see `live.point_edits`."""
    followed: deque[Followed] = field(default_factory=lambda: deque(maxlen=8))
    """What was done to the points of live hair last; see `live.point_edits`."""
    stood: dict[object, Stood] = field(default_factory=dict)
    """How live hair objects stood when last written, by identity, also those that are gone; see `live.joined_hair`."""


@dataclass(eq=False)
class Said:
    """What the panel says besides what it finds out each time."""

    messages: dict[str, str] = field(default_factory=dict)
    """What is wrong with a live object, by name."""
    misrendered: dict[str, str] = field(default_factory=dict)
    """What the last render showed wrongly, by armature name, until the next one begins."""
    cards: dict[str, list[str]] = field(default_factory=dict)
    """The lines of the last report card, by name of the hair object or armature."""
    trained: tuple[str, bool] | None = None
    """How the last training ended, and whether that is good news."""
    trained_notes: list[str] = field(default_factory=list)
    """Further notes on it."""

    def tell(self, name: str, error: Exception) -> None:
        """Say what went wrong with an object; what its user cannot fix is on the console as well."""
        if isinstance(error, (NeuralocksError, ReferenceError)):
            self.messages[name] = str(error)
        else:
            traceback.print_exception(error)
            self.messages[name] = f"{name}: unexpected {type(error).__name__}: {error}; see the console"


@dataclass(eq=False)
class Sampling:
    """The sampling in the background; see `background`."""

    done: float | None = None
    """Share of it that is done, while there is one."""
    wanting: bool = False
    """Whether live hair found its motion missing or out of date since this was last handled."""
    failed: set[str] = field(default_factory=set)
    """Armatures that could not be sampled; tried again when they, a rest pose or an action change."""


@dataclass(eq=False)
class Saving:
    """What is put back after the save that goes on."""

    blurred: list[str] = field(default_factory=list)
    """Hair of a render that goes on, which `scene.hair.blur` was taken off."""
    remade: Remade | None = None
    """Paths that were rewritten; see `scene.files.save_as`."""


session = Session()
