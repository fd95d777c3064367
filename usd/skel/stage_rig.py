# SPDX-License-Identifier: Apache-2.0
"""One skeleton of a stage, as read."""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from neuralocks_core.animation.cuts import APART, find_cuts, find_flashes
from neuralocks_core.animation.reference_pose import reference_end
from neuralocks_core.body.collider import Collider
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import LOOP_GAP, Clip, loop_turns

from ..border.time_codes import NEAR
from ..border.units import Border
from .bind_world import bind_shown
from .blend_shapes import all_shares
from .clip_codes import SAME
from .joints import JointSource
from .motion_sketch import motion_sketch
from .skin import Skin
from .surface import StageMesh


@dataclass(frozen=True)
class StageRig:
    """One skeleton with its body and motion.

    Attributes:
        path: the Skeleton prim.
        joints: the skeleton as authored.
        border: the stage's units.
        meshes: what it skins.
        to_bind: authored bind space to bind world [m], (4, 4).
        character: in core axes and metres.
        clip: world joint transforms at the time codes `time_codes`.
        time_codes: (T,).
        knots: blend shapes of the body, by name, with their `knot_weights`.
        notes: what a user should know about it.
        by_hand: semantic joint -> joint, as the user named them.
        outdated: whether its animation, or the one in whose place another is read, is a rig bake of one that has changed since.
    """

    path: str
    joints: JointSource = field(repr=False)
    border: Border
    meshes: list[StageMesh] = field(repr=False)
    to_bind: np.ndarray = field(repr=False)
    character: Character = field(repr=False)
    clip: Clip = field(repr=False)
    time_codes: np.ndarray = field(repr=False)
    knots: dict[str, list[float]] = field(repr=False)
    notes: list[str] = field(repr=False)
    by_hand: dict[str, str] = field(default_factory=dict, repr=False)
    outdated: bool = False
    _carrying: dict[tuple[int, float], np.ndarray] = field(default_factory=dict, repr=False, compare=False)

    def carrying_at(self, time_code: float) -> np.ndarray:
        """The carrying joint's motion from bind world [m] at a time code, (4, 4), cached: each groom of a crowd asks each character
        for it at the same few. The identity if it has no head.
        """
        if "head" not in self.character.humanoid:
            return np.eye(4)
        key = self.character.carrying_joint, time_code
        if key not in self._carrying:
            self._carrying[key] = self.character.carrying(self.joints_at(time_code))
        return self._carrying[key]

    @cached_property
    def carrying_at_rest(self) -> np.ndarray:
        """As `carrying_at`, in the rest pose."""
        if "head" not in self.character.humanoid:
            return np.eye(4)
        return self.character.carrying(self._joints_at_rest)

    @cached_property
    def bind_shown(self) -> np.ndarray:
        """See `bind_world.bind_shown`."""
        return bind_shown(self.joints)

    def joints_at(self, time_code: float) -> np.ndarray:
        """World joint transforms (J, 4, 4) [m] as a renderer sees them at a time code."""
        return self.border.to_core @ self.joints.posed([time_code])[0] @ self._trim

    @property
    def _joints_at_rest(self) -> np.ndarray:
        return self.border.to_core @ self.joints.at_rest @ self._trim

    def shape_at(self, time_code: float) -> np.ndarray:
        """Blend shape weights (B,) as a renderer sees them at a time code: between samples of the clip, the way from one to the next
        may lead past an inbetween, or step.
        """
        return all_shares(self.joints.shape(list(self.knots), [time_code]), self.knots)[0]

    def authored_turns(self, joints: np.ndarray, turns: np.ndarray) -> np.ndarray:
        """Turns (..., N, 4) wxyz of joints (N,) in the bind axes that the file gives them, from those in the core's: a turn about
        axes that `joint_trim` mirrors along x is (w, x, -y, -z) in the file's.
        """
        result = np.array(turns)
        result[..., self._trim[joints, 0, 0] < 0, 2:] *= -1
        return result

    def loop_notes(self, codes=(), replaced=()) -> list[str]:
        """What is wrong with the motion as a loop, whose last sample must show the pose of its first, and with time codes at
        which it is to be baked.

        Args:
            codes: ascending time codes that were asked for.
            replaced: joints that a bake replaces; how these move does not matter.
        """
        turn = loop_turns(self.cycle.joints[[0, -1]])
        turn[self.character.skeleton.below(*replaced)] = 0  # with what hangs from them
        start, end = self.time_codes[self._repeated][[0, -1]]
        notes = []
        if len(self.time_codes) < 2:
            return [f"{self.path}: has no animation, whose length a loop would have; gusts do not repeat"]
        if turn.max() > LOOP_GAP:
            # Joints below a joint turn with it, up to rounding: the first of them is the cause.
            name = self.joints.names[int(np.flatnonzero(turn > turn.max() - 0.1)[0])]
            notes.append(
                f"{self.path}: joint '{name}' is turned by {turn.max():.0f} degrees between time codes {start:g} and {end:g}; "
                "a loop must end with the pose that it begins with"
            )
        # Subframes of the last frame lie past the end, too, and samples may be rounded.
        near = NEAR * self.border.frame
        if len(codes) and (codes[0] < start - near or codes[-1] >= end + self.border.frame - near):
            notes.append(
                f"{self.path}: its animation goes from {start:g} to {end:g}; outside that range the hair goes on with the "
                "loop while the body stands still, so bake one cycle and repeat it"
            )
        return notes

    def cut_notes(self, loop: bool = False) -> list[str]:
        """Notes on where the hair starts anew, and where it does not although the head jumps, or leaps out of a reference pose; for a
        loop, in which it never does, on where it should.
        """
        if "head" not in self.character.humanoid:
            return []
        # A loop was read as if it had no cuts.
        cuts = find_cuts(self.clip, self.character.head) if loop else self.clip.cuts
        flashes = [] if loop else find_flashes(self.clip, self.character.head)
        what = (
            "a loop has no cuts, so the hair is flung there; leave out --loop, or repair the animation"
            if loop
            else "the hair starts anew there (--cuts says where)"
        )
        notes = [f"{self.path}: its head jumps to another place at {self._named(cuts)}; {what}"] if len(cuts) else []
        if len(flashes):
            every = self._named(np.union1d(cuts, flashes), most=100)
            notes.append(
                f"{self.path}: its head jumps at {self._named(flashes)}, less than {APART:g} s from one jump to the next, so these "
                f"are not taken as cuts and the hair is flung; repair the animation, or name them all if they are (--cuts {every})"
            )
        return notes if loop else [*notes, *self._reference_note(np.union1d(cuts, flashes), cuts)]

    def _reference_note(self, told: np.ndarray, cuts: np.ndarray) -> list[str]:
        """The note on a reference pose in the first samples, unless the jump from there is told already."""
        end = reference_end(self.clip, self.character, [self.character.skeleton.bind, self._joints_at_rest])
        if end is None or np.isclose(told, end).any():
            return []
        every = self._named(np.union1d(cuts, [end]), most=100)
        return [
            f"{self.path}: its animation begins with the bind or rest pose and leaps to another at {self._named(np.array([end]))}, which "
            f"flings the hair; if the first pose is only a reference, let the hair start anew there (--cuts {every})"
        ]

    def _named(self, times: np.ndarray, most: int = 8) -> str:
        """The time codes of samples of the clip [s], as `--cuts` takes them."""
        codes = self.time_codes[np.searchsorted(self.clip.times, times - 1e-9)]
        # Where a time code is a second, frames are its parts.
        digits = 3 + max(0, math.ceil(-math.log10(self.border.frame)))
        return ",".join(f"{round(code, digits):.15g}" for code in codes[:most]) + (", ..." if len(codes) > most else "")

    @cached_property
    def cycle(self) -> Clip:
        """The clip as a loop of the body's samples: a face that goes on longer, or a shot's range, is no part of it."""
        rows, clip = self._repeated, self.clip
        return replace(
            clip, times=clip.times[rows], joints=clip.joints[rows], shape=clip.shape[rows], loop=True, cuts=()
        )

    @cached_property
    def _repeated(self) -> slice:
        """Samples of the clip that are in a loop."""
        body, same = self.joints.keys.body or self.time_codes, SAME * self.border.frame
        # Of what is keyed together, the clip has the latest.
        return slice(*np.searchsorted(self.time_codes, [body[0] - same, body[-1] + same], side="right"))

    @cached_property
    def carried(self) -> dict[int, Character]:
        """By joint, the character with that joint as what carries hair, made by `carrying.carried_by`: all grooms of a joint share
        one, and with it what takes long to find on a dense body.
        """
        return {}

    @cached_property
    def skins(self) -> list[Skin]:
        """Each mesh in bind world [m], by nearness."""
        return [Skin(*mesh.in_bind(self.to_bind)) for mesh in self.meshes]

    @cached_property
    def surface(self) -> Collider | None:
        """The body in bind pose, for distances from its faces; None if it has no face."""
        body = self.character.body
        try:
            return None if body is None else Collider(body.points, body.triangles)
        except NeuralocksError:  # a mesh without faces
            return None

    @cached_property
    def vertices(self) -> cKDTree:
        """The body's vertices in bind pose."""
        return cKDTree(self.character.body.points)

    @cached_property
    def motion_sketch(self) -> str:
        """The `motion_sketch` of its skeleton."""
        return motion_sketch(self.joints, self.border.rate)

    @cached_property
    def _trim(self) -> np.ndarray:
        return joint_trim(self.joints, self.to_bind)


def joint_trim(source: JointSource, to_bind: np.ndarray) -> np.ndarray:
    """Per joint, the scale (J, 4, 4) that makes its bind transform a plain rotation and translation.

    Applied to bind and posed transforms alike it cancels; it keeps stage units, and the mirrored joint orients of some
    rigs, out of the core.
    """
    determinant = np.linalg.det((to_bind @ source.bind)[:, :3, :3])
    trim = np.zeros((len(determinant), 4, 4))
    size = 1 / np.cbrt(np.abs(determinant))
    trim[:, 0, 0] = size * np.sign(determinant)
    trim[:, 1, 1] = trim[:, 2, 2] = size
    trim[:, 3, 3] = 1
    return trim
