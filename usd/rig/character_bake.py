# SPDX-License-Identifier: Apache-2.0
"""One character of a rig bake: the model on its chains, its samples, the rotations of its hair joints, and notes on it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from pxr import UsdSkel

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig.carried import CarriedHair
from neuralocks_core.rig.network import RigModel
from neuralocks_core.wind import Wind

from ..border.time_codes import time_codes
from ..shot.notes.character_notes import lies_down
from ..shot.notes.skeleton_notes import not_animated, on_twos, without_turn
from ..shot.stage import check_frames_named, frame_range
from ..skel.clip_codes import SAME
from ..skel.old_copy import outdated_note
from ..skel.rig_copy import outdated_of
from .layer import kept_hair
from .notes import mirrored_notes, offset_notes, rigged_notes
from .stage import RiggedHair

STILL = 1e-4
"""A rotation that differs by less than this from the identity counts as none."""


@dataclass(frozen=True)
class BoundHair:
    """A rig model on the hair chains of one character of a shot.

    Attributes:
        hair: the character as read.
        model: with the names that its joints have here.
        size: how many times as large as the model's rig this one is.
        trained_name: what the model calls its first joint.
        wanted: the time codes that were asked for, see `time_codes.time_codes`.
        codes: `wanted` and the animation's own samples, because the body must come out sample for sample.
        outdated: joints of other hair that an earlier bake moves, as the animation was then.
    """

    hair: RiggedHair
    model: RigModel
    size: float
    trained_name: str
    wanted: list[float]
    codes: list[float]
    outdated: list[str]

    @classmethod
    def of(cls, hair: RiggedHair, model: RigModel, frames, subframes: int, windy: bool) -> "BoundHair":
        """Bind a model; `frames` and `subframes` are those of `bake.bake_rig`, `windy` whether a wind blows.

        Raises:
            NeuralocksError: it was made for other chains, a joint that it reads cannot be identified, or there are no such frames.
        """
        here, trained_name = hair.rig.chains, model.chains.names[0]
        if here.names != model.chains.names:
            model = replace(model, chains=replace(model.chains, names=here.names))
        try:
            size = model.chains.check_same(here)
        except NeuralocksError as error:
            raise NeuralocksError("; ".join([str(error), *_likelier(hair, model)])) from None
        if stops := without_turn(hair.stage_rig, model.spec.pose_joints):
            raise NeuralocksError(stops[0])
        first, last = frame_range(hair.stage, [hair.stage_rig])
        if windy:
            check_frames_named(hair.path, frames, first, last, [hair.stage_rig])
        wanted = time_codes(
            frames, first, last, subframes, hair.stage_rig.border.frame, hair.stage_rig.joints.keys.every
        )
        return cls(hair, model, size, trained_name, wanted, _with_samples(hair, wanted), _outdated(hair))

    @property
    def path(self) -> str:
        """The Skeleton prim."""
        return self.hair.path

    @property
    def joints(self) -> np.ndarray:
        """Indices of the hair joints in the skeleton, (N,)."""
        return self.hair.rig.chains.joints

    def turns(
        self, loop: bool, strength: float, wind: Wind | None, say: Callable[[], None]
    ) -> tuple[np.ndarray, list[str]]:
        """Turns of the hair joints (T, N, 4) wxyz in their own bind axes as authored, and notes on them.

        Args:
            loop, strength: see `bake.bake_rig`.
            wind: in core axes.
            say: called after each.

        Raises:
            NeuralocksError: the head is held as it was bound, so that no hair would move.
        """
        stage_rig, chains = self.hair.stage_rig, self.model.chains
        clip = stage_rig.cycle if loop else stage_rig.clip
        carried = CarriedHair(self.model, self.joints, stage_rig.character, clip)
        turns = np.empty((len(self.codes), len(chains), 4))
        for row, code in enumerate(self.codes):
            # One at a time: a matrix product may round otherwise for other batches.
            second = stage_rig.border.seconds([code])
            wrapped = clip.loop and not clip.start <= second[0] <= clip.end
            shown = clip.at(second) if wrapped else stage_rig.joints_at(code)[None]
            turns[row] = carried.turns(second, strength, shown, wind)[0]
            say()
        turns = stage_rig.authored_turns(self.joints, chains.turns_on(self.hair.rig.chains, turns))
        return turns, self._held(carried.carriers, turns, wind)

    def notes(self, loop: bool, find_cuts: bool) -> list[str]:
        """What a user should know before hair is turned."""
        rig, read = self.hair.stage_rig, self.model.spec.pose_joints
        return [
            *self._renamed(),
            *self._resized(),
            *self._read_otherwise(),
            *rigged_notes(rig, read),
            *_name_notes(rig.joints),
            *([outdated_note(rig.joints, self.outdated)] if self.outdated else []),
            *mirrored_notes(rig, self.hair.rig.chains),
            *offset_notes(rig, self.hair.rig.chains),
            *(rig.loop_notes(self.wanted, self.joints) if loop else []),
            *(on_twos(rig, read) if self.model.dynamic else []),
            *(rig.cut_notes(loop) if (loop or find_cuts) and self.model.dynamic else []),
        ]

    def _held(self, carriers: np.ndarray, turns: np.ndarray, wind: Wind | None) -> list[str]:
        """The note on a head that is held still, with all other joints that carry hair, in a calm; raises as `turns`."""
        rig = self.hair.stage_rig
        source, character, joints = rig.joints, rig.character, rig.clip.joints
        if np.ptp(joints[:, carriers], axis=0).max() >= 1e-7:
            return []
        if source.ignored:
            raise NeuralocksError(source.ignored)
        if wind:
            return []
        name = leaf(character.skeleton.names[character.head])
        turned = np.abs((joints[0, carriers] @ character.inverse_bind[carriers])[:, :3, :3] - np.eye(3)).max()
        if min(turned, np.abs(turns[..., 1:]).max()) < STILL:
            if source.animation is None:
                raise NeuralocksError(not_animated(rig))
            raise NeuralocksError(
                f"{rig.path}: its head joint '{name}' is not animated, so the hair would not move; "
                "animate the skeleton, or name the joint that carries the hair with --head JOINT"
            )
        return [f"{rig.path}: its head joint '{name}' does not move, so the hair is that of a held pose"]

    def _renamed(self) -> list[str]:
        """The note on joints whose names differ from those in the rig that the model was trained for."""
        here = self.model.chains.names[0]
        if here == self.trained_name:
            return []
        return [f"model: its joints have other names here, '{here}' for '{self.trained_name}'"]

    def _read_otherwise(self) -> list[str]:
        """The notes on joints that this rig has as the model's has them, but that others are read in place of."""
        stage_rig, reads = self.hair.stage_rig, self.model.training.get("reads")
        names, notes = [leaf(name) for name in stage_rig.joints.names], []
        for name in self.model.spec.pose_joints if isinstance(reads, dict) else ():
            now, trained = names[stage_rig.character.humanoid.nearest(name)], reads.get(name)
            if trained != now and trained in names:
                notes.append(
                    f"{stage_rig.path}: '{now}' is read as {name}, but in training '{trained}' was, which is here, too; check "
                    f"--joint {name}={trained}"
                )
        return notes

    def _resized(self) -> list[str]:
        """The note on a character of another size than the model's."""
        if self.size == 1:
            return []
        return [
            f"{self.hair.stage_rig.joints.path}: is {self.size:.2f} times as large as the character that the model was trained for; its "
            "hair swings as fast as that one's"
        ]


def _likelier(hair: RiggedHair, model: RigModel) -> list[str]:
    """What more likely explains that a model does not fit than another rig: a character that lies, or another head joint."""
    stage_rig, reads = hair.stage_rig, model.training.get("reads")
    trained = reads.get("head") if isinstance(reads, dict) else None
    head = leaf(stage_rig.joints.names[stage_rig.character.head])
    if trained != head and trained in map(leaf, stage_rig.joints.names):
        return [f"but in training the head was '{trained}', and here it is '{head}': check --head first"]
    return [f"but first: {note}" for note in lies_down(stage_rig)]


def _with_samples(hair: RiggedHair, wanted: list[float]) -> list[float]:
    """Time codes that were asked for and those at which the animation, or hair of an earlier bake that stays, has rotations."""
    source = hair.stage_rig.joints
    read = [source.animation] + [source.copied] * bool(kept_hair(source, hair.rig.chains.joints))
    attributes = [UsdSkel.Animation(prim).GetRotationsAttr() for prim in read if prim]
    own = sorted({code for attribute in attributes for code in attribute.GetTimeSamples()})
    # A frame and a sample at the same time, up to rounding, are one.
    edges = np.array([-np.inf, *own, np.inf])
    after = np.searchsorted(edges, wanted)
    near = np.minimum(edges[after] - wanted, wanted - edges[after - 1]) <= SAME * hair.stage_rig.border.frame
    return sorted({*np.array(wanted)[~near].tolist(), *own})


def _outdated(hair: RiggedHair) -> list[str]:
    """Joints of other hair that an earlier bake moves as the animation was then."""
    source = hair.stage_rig.joints
    kept = kept_hair(source, hair.rig.chains.joints)
    if kept and not hair.stage_rig.outdated:
        former = outdated_of(source.copied)
        return [name for name in kept if name in former]
    return list(kept)


def _name_notes(source) -> list[str]:
    """Blender names a bone after the last part of its joint's path, and cuts that at 63 bytes."""
    leaves = [leaf(name) for name in source.names]
    long = next((n for n in leaves if len(n.encode()) > 63), None)
    if long:
        return [f"{source.path}: the name of joint '{long}' has more than 63 bytes in UTF-8; Blender cuts it"]
    double = next((n for n in leaves if leaves.count(n) > 1), None)
    if double:
        return [f"{source.path}: several joints are named '{double}'; Blender renames all but one"]
    return []
