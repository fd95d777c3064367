# SPDX-License-Identifier: Apache-2.0
"""Training material made on the fly: short simulations of a few locks of hair on a moving body.

No outside data is needed: the motion is random, and the solver is our own. Rollout number i depends only on the seed and on
i, so any process can make any rollout, and a run that was killed resumes where it stopped.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from neuralocks_core.animation.random_motion import check_weights, random_clip
from neuralocks_core.body.tree_search import surface_tree
from neuralocks_core.boundary.history import BoundarySampler, joints_read
from neuralocks_core.boundary.smooth_motion import SmoothMotion
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.boundary.stepped import Stepped
from neuralocks_core.boundary.unscaled import unscaled
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import RANGES, Material, at_weight_one
from neuralocks_core.measures import body_measures
from neuralocks_core.motion import Clip
from neuralocks_core.strands.locks import lock_mates
from neuralocks_core.strands.strand_set import StrandSet
from neuralocks_core.training.data.hair_body import hair_body, posed_over_time

FINEST = 2.0**-15
"""[m] Displacements are multiples of this step, 0.03 mm, in two bytes; longer hair, which would not fit, has a larger step."""
SHAPES = 0.6
"""Weights of the body's blend shapes are between minus and plus this."""
FOLLOW = 0.04
"""[m] How far from the body hair still follows a change of its shape."""
PREROLL = 30
"""Frames at the start of a cut from motion capture that are simulated but not learned from: the hair was not at rest there."""
STOPS = 0.3
"""The share of random clips that stop midway: without them, a training sees little of how hair comes to rest, and its networks
swing on after a stop."""
LEAST = 0.6
"""Shorter motion, relative to a rollout, is not cut from: the body would stand still for most of what is learned."""


@dataclass(frozen=True)
class TrainingScene:
    """What rollouts are drawn from.

    Attributes:
        character: with its body.
        grooms: strands at rest; only valid ones are simulated.
        clips: motion to cut from, besides random motion; may be empty.
        spec: the network's inputs.
        seed: of all random choices.
        frames: length of a rollout, in steps of `spec.dt`, at least 3; with `clips`, at least PREROLL + 2.
        strands: strands of a rollout, in whole locks.
        gestures: how often random motion has each of its gestures, as `random_motion.check_weights` takes it.
        held_out: draw what training never sees: other locks, other random numbers, and no `clips`, since training cuts from all
            of each.
    """

    character: Character
    grooms: tuple[StrandSet, ...]
    clips: tuple[Clip, ...] = ()
    spec: BoundarySpec = field(default_factory=BoundarySpec)
    seed: int = 0
    frames: int = 110
    strands: int = 64
    gestures: dict[str, float] = field(default_factory=dict)
    held_out: bool = False

    def __post_init__(self):
        check_weights(self.gestures)
        least = PREROLL + 2 if self.clips else 3  # two frames that are learned from, so that they have a velocity
        if self.frames < least:
            raise NeuralocksError(f"frames: {self.frames} are too few for a rollout; give at least {least}")

    @property
    def span(self) -> float:
        """Length of a rollout [s]."""
        return (self.frames - 1) * self.spec.dt

    def usable(self, clip: Clip) -> list[Clip]:
        """The parts of given motion between its cuts that are long enough to cut rollouts from."""
        return [part for part in clip.parts if part.end - part.start > LEAST * self.span]


@dataclass(frozen=True, eq=False)
class Rollout:
    """One simulated clip.

    Attributes:
        groom: index into the scene's grooms.
        strands: (n,) indices of its strands.
        rest: their rest points on the body with its shape (n, 24, 3) float32, canonical space.
        first: first frame to learn from.
        vectors: boundary vectors (T, F) float32.
        bind: the anchor's vector (F,) float32.
        moved: displacement in canonical space (T, n, 24, 3) int16, in units of `step`.
        step: this unit [m].
        planes: nearest body plane of each vertex, (T, n, 24, 4) float16: normal, and offset from the rest vertex.
        residual: of the solver, rms relative to weight.
        materials: log-ratios of each strand's material (n, 4) float32 as the network reads them (`at_weight_one`), the same
            within a lock; `vectors` and `bind` have the first strand's.
    """

    groom: int
    strands: np.ndarray
    rest: np.ndarray
    first: int
    vectors: np.ndarray
    bind: np.ndarray
    moved: np.ndarray
    step: float
    planes: np.ndarray
    residual: float
    materials: np.ndarray


@dataclass(frozen=True, eq=False)
class Draw:
    """The random choices of a rollout.

    Attributes:
        groom: index into the scene's grooms.
        strands: (n,) indices of its strands.
        materials: of each strand, the same within a lock: one motion covers many materials at the cost of one. All have one
            weight, which says at what speed the motion is read.
        shape: blend shape weights.
        clip: the motion, without cuts; if it is on twos, the smooth motion through its poses.
        times: (T,) [s].
        first: first frame to learn from.
    """

    groom: int
    strands: np.ndarray
    materials: tuple[Material, ...]
    shape: np.ndarray
    clip: Clip
    times: np.ndarray
    first: int

    def joints(self, character: Character) -> np.ndarray:
        """World joint transforms (T, J, 4, 4) at its times, smooth between the clip's samples as its boundary vectors are: hair that
        felt a blow at each sample could not be learned from them. The head keeps its size.
        """
        return unscaled(character, SmoothMotion(character, self.clip).at(self.times))


class RolloutMaker:
    """Makes the rollouts of a scene; what all of them share is computed once."""

    def __init__(self, scene: TrainingScene):
        self.scene = scene
        lowest = min(groom.rest[..., 1].min() for groom in scene.grooms)
        self.body = hair_body(scene.character, reach=0.2 - float(lowest))
        self._usable = [held_out_split(groom, scene.held_out) for groom in scene.grooms]
        read = joints_read(scene.character)
        clips = () if scene.held_out else scene.clips
        self._captured = [Stepped.of(part, read).clip for clip in clips for part in scene.usable(clip)]
        self._surface = None
        if scene.character.body is not None and scene.character.body.shapes:
            self._surface = surface_tree(scene.character.canonical(scene.character.body.points))

    def make(self, index: int) -> Rollout:
        """Rollout number `index`."""
        from neuralocks_core.reference import simulate

        scene = self.scene
        draw = self.draw(index)
        joints = draw.joints(scene.character)
        groom = scene.grooms[draw.groom]
        rest = self.fitted(groom.rest[draw.strands].astype(np.float64), draw.shape)
        shape = draw.shape
        result = simulate(
            rest,
            scene.character.canonical_to_world(joints),
            None if self.body is None else posed_over_time(self.body, joints @ scene.character.inverse_bind, shape),
            None if self.body is None else self.body.triangles,
            {name: np.array([getattr(m, name) for m in draw.materials]) for name in RANGES},
            dt=scene.spec.dt,
            neighbours=lock_mates(rest, groom.lock[draw.strands]),
            bind_body=None if self.body is None else scene.character.canonical(self.body.shaped(shape)),
            planes=True,
        )
        moved = result.points - rest[None].astype(np.float32)
        planes = result.planes
        planes[..., 3] -= np.einsum("tnki,nki->tnk", planes[..., :3], rest)
        vectors, bind = self.vectors(draw, scene.spec)
        moved, step = in_steps(moved)
        return Rollout(
            groom=draw.groom,
            strands=draw.strands,
            rest=rest.astype(np.float32),
            first=draw.first,
            vectors=vectors,
            bind=bind,
            moved=moved,
            step=step,
            planes=np.clip(planes, -1000, 1000).astype(np.float16),
            residual=float(np.median(result.residual)),
            materials=at_weight_one([m.log_ratios() for m in draw.materials])[0].astype(np.float32),
        )

    def reread(self, index: int, rollout: Rollout, spec: BoundarySpec) -> Rollout:
        """The same rollout as a network with another boundary history reads it; nothing is simulated again."""
        vectors, bind = self.vectors(self.draw(index), spec)
        return replace(rollout, vectors=vectors, bind=bind)

    def draw(self, index: int) -> Draw:
        """Make all random choices of a rollout, in one place and order."""
        rng = np.random.default_rng([self.scene.seed, self.scene.held_out, index])
        which = int(rng.integers(len(self.scene.grooms)))
        strands = self._locks(which, rng)
        locks, lock = np.unique(self.scene.grooms[which].lock[strands], return_inverse=True)
        by_lock = [Material.random(rng)]
        # Materials have their own random generator, so that motion does not depend on the number of locks.
        others = np.random.default_rng([self.scene.seed, self.scene.held_out, index, 1])
        by_lock += [Material.random(others) for _ in locks[1:]]
        by_lock = [replace(material, weight=by_lock[0].weight) for material in by_lock]
        by_lock[lock[0]], by_lock[0] = by_lock[0], by_lock[lock[0]]
        shape = self._shape(rng)
        return Draw(which, strands, tuple(by_lock[i] for i in lock), shape, *self._motion(rng, shape))

    def vectors(self, draw: Draw, spec: BoundarySpec) -> tuple[np.ndarray, np.ndarray]:
        """Boundary vectors (T, F) of a draw, and the anchor's (F,)."""
        sampler = BoundarySampler(spec, self.scene.character, draw.clip)
        log = draw.materials[0].log_ratios()
        return sampler.vectors(draw.times, log), sampler.held_bind(log, draw.shape)

    def _locks(self, which: int, rng) -> np.ndarray:
        """Indices of whole locks, cut to the scene's number of strands; for locks of over 8 strands, a neighbourhood of each."""
        groom, usable = self.scene.grooms[which], self._usable[which]
        chosen: dict[int, None] = {}  # a set that keeps its order
        while len(chosen) < min(self.scene.strands, len(usable)):
            seed = usable[rng.integers(len(usable))]
            lock = usable[groom.lock[usable] == groom.lock[seed]]
            near = np.argsort(np.linalg.norm(groom.rest[lock, 0] - groom.rest[seed, 0], axis=1), kind="stable")[:8]
            chosen.update(dict.fromkeys(lock[near].tolist()))
            chosen[int(seed)] = None  # it is not among the 8 where more strands have one root
        return np.array(sorted(list(chosen)[: self.scene.strands]))

    def _shape(self, rng) -> np.ndarray:
        count = 0 if self.scene.character.body is None else len(self.scene.character.body.shapes)
        return rng.uniform(-1, 1, count) * rng.choice([0.0, SHAPES])

    def _motion(self, rng, shape) -> tuple[Clip, np.ndarray, int]:
        scene, clips, span = self.scene, self._captured, self.scene.span
        if clips and rng.random() < 0.35:
            source = clips[rng.integers(len(clips))]
            start = rng.uniform(source.start, max(source.start, source.end - span))
            clip, first = Clip(source.times, source.joints, np.tile(shape, (len(source.times), 1))), PREROLL
        else:
            clip = random_clip(scene.character, rng, span, shape=shape, weights=scene.gestures, stops=STOPS)
            start, first = clip.start, 1
        return clip, start + scene.spec.dt * np.arange(scene.frames), first

    def fitted(self, rest: np.ndarray, shape: np.ndarray) -> np.ndarray:
        """Rest strands (n, 24, 3) fitted to a body of another shape, as an artist would do it.

        Roots follow the scalp; hair on the body follows the body, free hair follows its root.
        """
        if self._surface is None or not shape.any():
            return rest
        body, facing = self.scene.character.body, self.scene.character.facing
        distance, nearest = self._surface.query(rest)
        offset = sum(w * offsets[nearest] for w, offsets in zip(shape, body.shapes.values())) @ facing.T
        return rest + offset[:, :1] + np.exp(-distance / FOLLOW)[..., None] * (offset - offset[:, :1])


def in_steps(moved: np.ndarray) -> tuple[np.ndarray, float]:
    """Displacements [m] as int16, and their step [m], as fine as the largest of them allows."""
    step = max(FINEST, 2.0 ** np.ceil(np.log2(np.abs(moved).max(initial=FINEST) / 32767)))
    return np.round(moved / step).astype(np.int16), float(step)


def learned_measures(character: Character) -> np.ndarray:
    """The lowest and the highest `body_measures` (2, 10) [m] of a training's bodies, from the extremes of each blend shape and
    some random draws.
    """
    count = 0 if character.body is None else len(character.body.shapes)
    each = SHAPES * np.eye(count)
    drawn = np.random.default_rng(0).uniform(-SHAPES, SHAPES, (100 if count else 0, count))
    every = np.array([body_measures(character, shape) for shape in [np.zeros(count), *each, *-each, *drawn]])
    return np.array([every.min(axis=0), every.max(axis=0)])


def held_out_split(groom: StrandSet, held_out: bool) -> np.ndarray:
    """Indices of the valid strands in every eighth lock (`held_out`), or in the others; all if there are too few
    locks.
    """
    kept_back = (groom.lock % 8 == 7) == held_out
    usable = np.flatnonzero(groom.valid & kept_back)
    return usable if len(usable) else np.flatnonzero(groom.valid)


def kept_from_training(groom: StrandSet) -> int:
    """How many strands `held_out_split` keeps from training; 0 if there are too few locks."""
    return len(np.setdiff1d(held_out_split(groom, True), held_out_split(groom, False)))
