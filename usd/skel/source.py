# SPDX-License-Identifier: Apache-2.0
"""A skeleton of the stage as a Character and a Clip: metres, Y up, world space."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from pxr import Usd, UsdSkel
from scipy.spatial import cKDTree

from neuralocks_core.anatomy.humanoid import Humanoid, NoHead, find_humanoid
from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.animation.cuts import APART, find_cuts, find_flashes
from neuralocks_core.body.collider import Collider
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import LOOP_GAP, Clip
from neuralocks_core.rotation import angle_between, transformed

from ..border.units import Border
from .bind_world import to_bind_world
from .blend_shapes import knot_weights, shares
from .clip_codes import clip_codes
from .joints import JointSource
from .motion_sketch import motion_sketch
from .rig_copy import alike, hair_of, source_of
from .surface import Skins, StageMesh, bound_meshes, find_skins, merged_body, not_posed

COMPARED = 100
"""About so many poses of a rig bake are compared with those that it was made from."""


@dataclass(frozen=True)
class StageRig:
    """One skeleton with its body and motion.

    Attributes:
        path: the Skeleton prim.
        source: the skeleton as authored.
        border: the stage's units.
        meshes: what it skins.
        to_bind: authored bind space to bind world [m], (4, 4).
        character: in core axes and metres.
        clip: world joint transforms at the time codes `time_codes`.
        time_codes: (T,).
        notes: what a user should know about it.
        by_hand: semantic joint -> joint, as the user named them.
    """

    path: str
    source: JointSource = field(repr=False)
    border: Border
    meshes: list[StageMesh] = field(repr=False)
    to_bind: np.ndarray = field(repr=False)
    character: Character = field(repr=False)
    clip: Clip = field(repr=False)
    time_codes: np.ndarray = field(repr=False)
    notes: list[str] = field(repr=False)
    by_hand: dict[str, str] = field(default_factory=dict, repr=False)
    _carrying: dict[tuple[int, float], np.ndarray] = field(default_factory=dict, repr=False, compare=False)

    def carrying_at(self, time_code: float) -> np.ndarray:
        """What the carrying joint does to bind world [m] at a time code, (4, 4), remembered: each groom of a crowd asks each
        character for it at the same few; nothing where it has no head.
        """
        if "head" not in self.character.humanoid:
            return np.eye(4)
        key = self.character.carrying_joint, time_code
        if key not in self._carrying:
            self._carrying[key] = self.character.carrying(self.joints_at(time_code))
        return self._carrying[key]

    def joints_at(self, time_code: float) -> np.ndarray:
        """World joint transforms (J, 4, 4) [m] as a renderer sees them at a time code."""
        return self._to_world @ self.source.posed([time_code])[0] @ self._trim

    def authored_turns(self, joints: np.ndarray, turns: np.ndarray) -> np.ndarray:
        """Turns (..., N, 4) wxyz of joints (N,) in the bind axes that the file gives them, out of those in the core's: a turn
        about axes that `joint_trim` mirrors along x is (w, x, -y, -z) in the file's.
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
        ends = self.clip.joints[[0, -1], :, :3, :3]
        first, last = ends / np.cbrt(np.linalg.det(ends))[..., None, None]
        turn = np.degrees(angle_between(first, last))
        for joint in replaced:  # and what hangs from it
            turn[self.character.skeleton.below(joint)] = 0
        start, end = self.time_codes[[0, -1]]
        notes = []
        if turn.max() > LOOP_GAP:
            # What hangs from a joint turns with it, up to rounding: the first of them is the one that does.
            name = self.source.names[int(np.flatnonzero(turn > turn.max() - 0.1)[0])]
            notes.append(
                f"{self.path}: joint '{name}' is turned by {turn.max():.0f} degrees between time codes {start:g} and {end:g}; "
                "a loop ends with the pose that it begins with"
            )
        if len(codes) and (codes[0] < start or codes[-1] > end):
            notes.append(
                f"{self.path}: its animation goes from {start:g} to {end:g}; outside of that its hair moves on as the loop "
                "does while the body stands, so bake one round and repeat it"
            )
        return notes

    def cut_notes(self, loop: bool = False) -> list[str]:
        """Where the hair starts anew, if it does anywhere, and where it does not, though the head leaps; of a loop, in which it
        never does, where it ought to.
        """
        if "head" not in self.character.humanoid:
            return []
        # A loop was read as if it had none.
        cuts = find_cuts(self.clip, self.character.head) if loop else self.clip.cuts
        flashes = [] if loop else find_flashes(self.clip, self.character.head)
        what = (
            "a loop has no cuts, so the hair is flung there; leave out --loop, or repair the animation"
            if loop
            else "the hair starts anew there (--cuts says where)"
        )
        notes = [f"{self.path}: its head is put elsewhere at {self._named(cuts)}; {what}"] if len(cuts) else []
        if len(flashes):
            every = self._named(np.union1d(cuts, flashes))
            notes.append(
                f"{self.path}: its head leaps at {self._named(flashes)}, less than {APART:g} s from one leap to the next, so these "
                f"are no cuts and the hair is flung; repair the animation, or name them all if they are (--cuts {every})"
            )
        return notes

    def _named(self, times: np.ndarray) -> str:
        """The time codes of samples of the clip [s], as `--cuts` takes them."""
        codes = self.time_codes[np.searchsorted(self.clip.times, times - 1e-9)]
        return ",".join(f"{code:g}" for code in codes[:8]) + (", ..." if len(codes) > 8 else "")

    @cached_property
    def skins(self) -> list[cKDTree]:
        """The points of each mesh in bind world [m], by nearness."""
        return [cKDTree(transformed(mesh.points, self.to_bind @ mesh.geom_bind)) for mesh in self.meshes]

    @cached_property
    def surface(self) -> Collider | None:
        """The body in bind pose, for distances from its faces; None where it has no face."""
        body = self.character.body
        try:
            return None if body is None else Collider(body.points, body.triangles)
        except NeuralocksError:  # a mesh of points alone
            return None

    @cached_property
    def motion_sketch(self) -> str:
        """What `motion_sketch` tells of it."""
        return motion_sketch(self.source, self.border.rate)

    @cached_property
    def _to_world(self) -> np.ndarray:
        return self.border.to_core

    @cached_property
    def _trim(self) -> np.ndarray:
        return joint_trim(self.source, self.to_bind)


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


def read_rig(
    stage: Usd.Stage,
    prim: Usd.Prim,
    border: Border,
    head: str | None = None,
    *,
    all_shapes: bool = False,
    joints=None,
    cuts: list[float] | None = None,
    skins: Skins | None = None,
    headless: bool = False,
    unbaked: bool = False,
) -> StageRig:
    """Read a skeleton, its meshes and its motion.

    Args:
        stage: the shot.
        prim: the Skeleton.
        border: the stage's units.
        head: joint that is the head; found by name and hierarchy if left out.
        all_shapes: keep blend shapes that the animation does not use.
        joints: semantic joint -> joint path or its last part, where names do not tell.
        cuts: time codes from which the character is elsewhere; found if None. Those outside the animation are ignored.
        skins: of the stage, if they were looked for already.
        headless: read it without a head, and without any other joint's meaning, where no joint is named like one.
        unbaked: of a rig bake, the animation that it was made from, with a note where the two differ.

    Raises:
        NoHead: no joint is named like a head.
        NeuralocksError: something in it cannot be used; the message names the prim.
    """
    source = JointSource(prim, unbaked)
    notes = source.notes
    time_codes = clip_codes(source, border)
    notes += _old_copy(source, time_codes)
    posed = source.posed(time_codes)
    meshes = bound_meshes(find_skins(stage) if skins is None else skins, source, notes)
    notes += not_posed(meshes, source)
    by_hand = {**(joints or {}), **({"head": head} if head else {})}
    try:
        humanoid = _humanoid(source, by_hand)
    except NoHead:
        if not headless:
            raise
        humanoid = Humanoid({})
    notes += _twice(source, by_hand, humanoid)
    to_bind = to_bind_world(source, border, posed, humanoid)
    trim = joint_trim(source, to_bind)
    skeleton = Skeleton(source.names, source.parents, to_bind @ source.bind @ trim)
    knots = knot_weights([mesh.shapes for mesh in meshes])
    weights = dict(zip(knots, source.shape(list(knots), time_codes).T, strict=True))
    used = {name: column for name, column in weights.items() if all_shapes or column.any()}
    body = merged_body(meshes, to_bind, set(used))
    character = Character(skeleton, body, humanoid)
    clip = Clip(
        border.seconds(time_codes),
        border.to_core @ posed @ trim,
        np.concatenate([np.zeros((len(posed), 0)), *(shares(w, knots[name]) for name, w in used.items())], axis=1),
    )
    if cuts is not None:
        known = border.seconds([cut for cut in sorted(cuts) if time_codes[0] < cut <= time_codes[-1]])
    else:
        known = find_cuts(clip, character.head) if "head" in humanoid else ()
    clip = replace(clip, cuts=known)
    return StageRig(
        path=source.path,
        source=source,
        border=border,
        meshes=meshes,
        to_bind=to_bind,
        character=character,
        clip=clip,
        time_codes=time_codes,
        notes=notes,
        by_hand=by_hand,
    )


def find_skeletons(stage: Usd.Stage) -> list[Usd.Prim]:
    """Skeleton prims in stage order."""
    every = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    return [prim for prim in every if prim.IsA(UsdSkel.Skeleton)]


def _old_copy(source: JointSource, time_codes: np.ndarray) -> list[str]:
    """The note on a rig bake whose body does not move as the animation does that it was made from."""
    copy = source.copied or source.animation
    original = copy and source_of(copy)
    if not original:
        return []
    codes, hair = time_codes[:: max(1, len(time_codes) // COMPARED)], hair_of(copy)
    body = [joint for joint, name in enumerate(source.names) if name not in hair]
    try:
        both = [JointSource(source.prim, unbaked) for unbaked in (False, True)]
        same = alike(*(each.local(codes)[:, body] for each in both))
        if same and np.allclose(*(each.shape(both[1].shape_names, codes) for each in both), atol=1e-4):
            return []
    except NeuralocksError:  # whichever is read tells it
        return []
    fact = (
        f"{source.path}: its animation {copy.GetName()} is a rig bake of {original.GetPath()}, which has changed since"
    )
    return [f"{fact}; {'what that shows is read' if source.copied else 'bake the rig again'}"]


def _humanoid(source: JointSource, by_hand: dict[str, str]) -> Humanoid:
    try:
        return find_humanoid(source.names, source.parents, source.bind[:, :3, 3], by_hand)
    except NeuralocksError as error:
        raise type(error)(f"{source.path}: {str(error).removeprefix('skeleton: ')}") from None


def _twice(source: JointSource, by_hand: dict[str, str], humanoid: Humanoid) -> list[str]:
    """The notes on joints that the user gave a meaning while they have another one, too: one does not turn against itself."""
    said = {}
    for name in by_hand:
        others = [other for other in humanoid if other != name and humanoid[other] == humanoid[name]]
        if others:
            joint = leaf(source.names[humanoid[name]])
            meanings = " and ".join(sorted([name, *others]))
            said[joint] = f"{source.path}: joint '{joint}' is {meanings} at once; check --joint and --head"
    return list(said.values())
