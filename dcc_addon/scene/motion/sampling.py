# SPDX-License-Identifier: GPL-3.0-or-later
"""Sampling a rig's motion by stepping through the frames, so that it includes constraints, IK, drivers and NLA."""

import math
import time
from collections.abc import Generator, Iterator
from dataclasses import replace

import numpy as np

from neuralocks_core.anatomy.hierarchy import ancestors
from neuralocks_core.animation.cuts import find_cuts
from neuralocks_core.motion import Clip

from ...sampled_rig import SampledRig
from ...services.rigs import following
from ...services.rigs import rig as rig_service
from ...services.rigs.axes import to_core
from ...services.rigs.hidden import check_placed, unhidden
from ...services.rigs.leaps import leaps_told
from ...services.rigs.motion import Motion, frame_numbers, trim_of
from ...session import session
from ..character import armature as armature_reader
from ..character import body as body_reader
from ..character import body_drawn, riding, rigid_parts
from ..character.binding import apart_at_rest, bind_places, hidden
from ..character.carried import bodies_of, hairs_of
from ..character.layers import graph_of, layer_of, working_in
from ..character.placing import world
from ..drawing.clock import rate_of, shown_frame
from ..drawing.hidden_objects import watched
from ..objects.lookup import find, named
from ..objects.relations import found_anew
from .dependencies import frames_of, key_of, moved_by, posture_of, rigging_of
from .rigging import unreported
from .stepping import step, stepping

BLOCK, MANY = 256, 6000
"""Most frames whose poses are converted to channels together, and most joints in all of them: on so few numbers, one frame costs as
much as a block, and a block takes about a slice of work.
"""


def in_slices(context, armature, seconds: float = math.inf) -> Iterator[tuple[int, int]]:
    """Sample an armature's motion, `seconds` at a time, and put it into the session at the end; yields (done, total) between two
    slices, when the scene is as it was before, and can be viewed and edited. If that changed what is sampled, such as the name of
    its hair, it begins again.

    Raises:
        NeuralocksError: the armature cannot be sampled; says why in plain words.
    """
    scene, name = context.scene, armature.name_full
    while True:
        key, frames = key_of(armature, scene), _sample(context, scene, armature)
        while True:
            end = time.perf_counter() + seconds  # in a large scene, comparing takes a part of the slice
            if key != key_of(armature, scene):
                break
            with stepping(scene):
                reached = next((each for each in frames if time.perf_counter() > end), None)
            if reached is None:
                return
            yield reached
            armature = named(name)


def _sample(context, scene, armature) -> Iterator[tuple[int, int]]:
    """Step through the frames of a scene; yields (done, total)."""
    found_anew()
    recording = _Recording(context, scene, armature)
    total = len(recording.frames)
    yield 0, total
    for body in bodies_of(armature, scene):
        for _ in body_reader.weighed(body):
            yield 0, total
    for row in range(total):
        recording.take(row)
        yield row + 1, total
    session.renew_motion(recording.name, (yield from recording.sampled()))


class _Recording:
    """An armature's motion, and that of what it carries, while the scene's frames are stepped. Poses are converted to channels some
    frames at a time: for hundreds of bones, all at once would block Blender for seconds.
    """

    def __init__(self, context, scene, armature):
        self._context, self._scene, self.name = context, scene, armature.name_full
        self._rig = armature_reader.read(armature, armature.neuralocks_character.head_bone)
        humanoid = self._rig.humanoid
        self._head = humanoid["head"]
        self._needed = {above for joint in humanoid.values() for above in ancestors(joint, self._rig.parents)}
        bodies = bodies_of(armature, scene)
        self._bodies = [body.name_full for body in bodies]
        self._rigid = [part.name_full for part in rigid_parts.find(armature, bodies, scene)]
        self._tracked = [*(hair.name_full for hair in hairs_of(armature, scene)), *self._bodies]
        self._depends = {
            "key": key_of(armature, scene),
            "rigging": rigging_of(armature, scene),
            "posture": posture_of(armature, scene),
            "unreported": {body.name_full: unreported(body) for body in bodies},
            "moved_by": moved_by(armature, scene),
        }
        self._edits = session.edits
        self.frames = frame_numbers(*frames_of(scene), scene.neuralocks.subframes)
        self._rate = rate_of(scene)
        self._unit = scene.unit_settings.scale_length
        count, bones = len(self.frames), len(self._rig.bones)
        self._block = min(BLOCK, max(1, MANY // bones))
        self._pose, self._basis = np.empty((2, self._block, len(armature.pose.bones), 4, 4), np.float32)
        self._parts = []
        self._drawn, self._world = np.empty((count, bones, 4, 4), np.float32), np.empty((count, bones, 4, 4))
        self._own = np.empty((count, bones, 3, 3), np.float32)
        self._heads, self._shown = np.empty((count, 4, 4)), np.empty((count, 4, 4))
        self._places = {name: np.empty((count, 4, 4)) for name in ["", *self._tracked]}
        self._shapes, self._bodies_at, self._looked = [], {}, {count // 2, count - 1}
        self._reader = None

    def take(self, row: int) -> None:
        """Step to a frame and read it, in a view layer in which the armature moves, whichever is in view; objects are looked up
        again, since handlers may have changed them.
        """
        layer = None if row else layer_of(named(self.name), self._scene)
        if layer is not None and layer.depsgraph is None:
            # Blender writes poses back to objects only after its own evaluation, which a scene that was never shown has not had:
            # objects tagged by reading the first frame would be at the file's frame.
            graph_of(self._scene, layer)
        if row and abs(shown_frame(self._scene) - self.frames[row - 1]) > 1e-3:
            step(self._scene, self.frames[row - 1])  # a simulation continues only from the previous frame
        step(self._scene, self.frames[row])
        armature = named(self.name)
        layer = layer_of(armature, self._scene)
        if layer is None:
            raise hidden(armature)
        tracked = [named(name) for name in self._tracked]
        with watched(self._scene, layer, tracked) as any_hidden:
            if any_hidden:  # their shape keys are still those of another frame
                step(self._scene, self.frames[row])
                armature, tracked = named(self.name), [named(name) for name in self._tracked]
            with working_in(self._scene, layer):
                self._read(row, armature, tracked)
        if (row + 1) % self._block == 0 or row == len(self.frames) - 1:
            self._store(row - row % self._block, row + 1)

    def _read(self, row: int, armature, tracked: list) -> None:
        """Read the frame that the scene shows, of the armature and the objects that it carries, bodies last."""
        graph = self._context.evaluated_depsgraph_get()
        evaluated = armature.evaluated_get(graph)
        if not evaluated.is_evaluated:
            raise hidden(armature)
        if not row:
            self._reader = armature_reader.PoseReader(armature, self._rig.bones)
            here = armature_reader.matrix(evaluated.matrix_world)
            check_placed(here[None], self.frames, self.name)
            self._place = rig_service.stood_up(self._rig, here)
            self._bind = self._place @ self._rig.rest
            self._trim = trim_of(self._bind, self.name)
            placed = [*self._tracked, *self._rigid]
            binds = bind_places(self._context, armature, placed, self._reader, self._rig.rest)
            # Not even rounding may move what already stands upright: hair pushed out of a body would jump.
            up = np.eye(4) if np.array_equal(self._place, here) else self._place @ np.linalg.inv(here)
            self._binds = {name: up @ bind for name, bind in binds.items()}
            graph = self._context.evaluated_depsgraph_get()
            evaluated = armature.evaluated_get(graph)
        self._reader.record(evaluated, self._pose[row % self._block], self._basis[row % self._block])
        self._places[""][row] = armature_reader.matrix(evaluated.matrix_world)
        for name, other in zip(self._tracked, tracked, strict=True):
            self._places[name][row] = world(other, graph)
        bodies = tracked[len(tracked) - len(self._bodies) :]
        values = [body_reader.shape_values(body, graph) for body in bodies]
        self._shapes.append(np.concatenate([np.zeros(0), *values]))
        if row in self._looked:
            self._bodies_at[row] = [body_drawn.drawn(body, graph) for body in bodies]

    def _store(self, first: int, end: int) -> None:
        """Convert the poses of some rows to channels."""
        rows, kept = slice(first, end), slice(end - first)
        check_placed(self._places[""][rows], self.frames[rows], self.name)
        drawn = self._reader.posed(self._pose[kept], self._places[""][rows])
        joints = unhidden(drawn, self._rig, self._needed, self.frames[rows])
        part = Motion.from_world(
            frames=self.frames[rows],
            rate=self._rate,
            metres_per_unit=self._unit,
            parents=self._rig.parents,
            bind=self._bind,
            joints=joints,
            shape=np.array(self._shapes[rows]),
            subject=self.name,
            head=self._head,
        )
        world = part.world()
        self._parts.append(part)
        self._world[rows] = to_core(self._unit) @ world
        self._drawn[rows], self._own[rows] = drawn @ self._trim, self._reader.own(self._basis[kept])
        self._heads[rows], self._shown[rows] = joints[:, self._head], world[:, self._head]

    def _moved(self, joint: int) -> np.ndarray:
        """World transforms (T, 4, 4) of a joint as Blender gave them, except for rounding to single precision."""
        return self._drawn[:, joint].astype(float) @ np.linalg.inv(self._trim[joint])

    def _hairs(self) -> dict:
        """The hair objects that are still there, by name."""
        names = (name for name in self._tracked if name not in self._bodies)
        return {name: hair for name in names if (hair := find(name)) is not None}

    def _bind_by_motion(self, carriers: dict[str, int], hairs: dict) -> None:
        """Set where all that is tracked stands in bind pose, if its motion with what carries it, by name, tells."""
        places, binds = self._places, self._binds
        for other in self._tracked:
            joint = carriers.get(other, self._head)
            joints = self._heads if joint == self._head else self._moved(joint)
            own = following.on_joint(places[other], places[""], joints, self._bind[joint])
            if own is None and other in hairs and apart_at_rest(hairs[other], named(self.name)):
                own = following.in_first(places[other], joints, self._bind[joint])
            binds[other] = binds[other] if own is None else own

    def sampled(self) -> Generator[tuple[int, int], None, SampledRig]:
        """What was read, as the character and clip that live view and bake use; yields (done, total) while a large body would block
        Blender.
        """
        rig, done = self._rig, (len(self.frames), len(self.frames))
        motion, binds = Motion.joined(self._parts, self._places), self._binds
        hairs = self._hairs()
        of_hairs = {name: self._places[name] for name in hairs}
        carriers = riding.carriers(rig, self._head, self._heads, self._moved, of_hairs)
        self._bind_by_motion(carriers, hairs)
        yield done
        arrays = []
        for body in self._bodies:
            arrays.append((body_reader.read(named(body), named(self.name)), binds[body]))
            yield done
        metres = self._unit * rig_service.size_shown(rig, self._place, self._shown)
        character = rig_service.character(rig, self._place, arrays, metres)
        yield done
        armature = named(self.name)
        clip = Clip(motion.times, self._world, motion.shape, armature.neuralocks_character.loop)
        clip = replace(clip, cuts=find_cuts(clip, character.head))
        before, carried = session.rigs.get(self.name), {}
        if before is not None and rig_service.same(before.character, character):
            character, carried = before.character, before.carried
        hairs = self._hairs()  # whoever works meanwhile may have deleted some
        on_head = [hair for name, hair in hairs.items() if name not in carriers]
        parts = [part for name in self._rigid if (part := find(name)) is not None]
        bodies = tuple(body for body, _ in arrays)
        return SampledRig(
            rig=rig,
            motion=motion,
            character=character,
            clip=clip,
            trim=self._trim,
            reader=self._reader,
            bind_places=binds,
            bind_metres=metres,
            drawn=self._drawn,
            own=self._own,
            **self._depends,
            stale=self._edits != session.edits,
            carriers=carriers,
            carried=carried,
            body_arrays=bodies,
            bodies_off=(
                *body_drawn.all_told(armature, bodies, self._bodies_at, character, clip, self._unit),
                *rigid_parts.told(armature, parts, list(hairs.values()), binds),
            ),
            leaps=leaps_told(clip, character, motion.frames),
            hairs_off=riding.strays_told(on_head, rig, self._heads, self._moved, self._places, self._unit),
        )
