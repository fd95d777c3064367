# SPDX-License-Identifier: GPL-3.0-or-later
"""Sampling a rig's motion by stepping through the frames, so that constraints, IK, drivers and NLA count."""

from collections.abc import Iterator

import numpy as np

from neuralocks_core.errors import NeuralocksError

from ..services import rig as rig_service
from ..services.axes import to_core
from ..services.motion import Motion, frame_numbers, trim_of
from ..session import SampledRig, session
from . import armature as armature_reader
from . import body as body_reader
from .binding import bind_places, hidden
from .lookup import find
from .placing import world
from .unkeyed import Unkeyed


def hairs_of(armature, scene) -> list:
    """Hair objects of the scene that this armature carries."""
    return [o for o in scene.objects if o.type == "CURVES" and o.neuralocks_hair.armature == armature]


def bodies_of(armature, scene) -> list:
    """The body mesh chosen by the artist, else all that the armature deforms."""
    chosen = armature.neuralocks_character.body
    if chosen is not None and chosen.name in scene.objects:
        return [chosen]
    return body_reader.find(armature, scene.objects)


def shown_frame(scene) -> float:
    """The frame that is shown, with its fraction, as the timeline counts; Blender's `frame_current_final` counts
    stretched time.
    """
    return scene.frame_current + scene.frame_subframe


def frames_of(scene) -> tuple[int, int]:
    """First and last frame to sample: those of the scene, and where the panel names others to bake, these too. What is
    shown and what is baked then remember the same past.
    """
    settings, first, last = scene.neuralocks, scene.frame_start, scene.frame_end
    if settings.use_scene_range:
        return first, last
    return min(first, settings.frame_start), max(last, settings.frame_end)


def timing_of(scene) -> tuple:
    """What a sampling depends on of the scene: frames, sub-frames, rate, unit."""
    return (
        *frames_of(scene),
        scene.neuralocks.subframes,
        round(scene.render.fps / scene.render.fps_base, 6),
        round(scene.unit_settings.scale_length, 9),
    )


def key_of(armature, scene) -> tuple:
    """What a sampling of this armature depends on besides its animation; first `timing_of`."""
    settings, bodies = armature.neuralocks_character, bodies_of(armature, scene)
    return (
        timing_of(scene),
        tuple(body.name_full for body in bodies),
        settings.head_bone,
        tuple(armature.data.bones.keys()),
        tuple(sorted(o.name_full for o in hairs_of(armature, scene))),
    )


def sample(context, armature) -> Iterator[tuple[int, int]]:
    """Step through the frames; yields (done, total) and puts the result into the session at the end.

    The current frame is put back between the yields only by the caller (see `stepping`), and always at the end.

    Raises:
        NeuralocksError: the armature cannot be sampled, in plain words.
    """
    scene = context.scene
    rig = armature_reader.read(armature, armature.neuralocks_character.head_bone)
    rig.humanoid()
    bodies = [body.name_full for body in bodies_of(armature, scene)]
    tracked = [*(hair.name_full for hair in hairs_of(armature, scene)), *bodies]
    frames = frame_numbers(*frames_of(scene), scene.neuralocks.subframes)
    key = key_of(armature, scene)
    joints = np.empty((len(frames), len(rig.bones), 4, 4))
    places = {name: np.empty((len(frames), 4, 4)) for name in ["", *tracked]}
    shapes = []
    name = armature.name_full
    for row, frame in enumerate(frames):
        whole = int(np.floor(frame + 1e-6))
        scene.frame_set(whole, subframe=max(0.0, float(frame - whole)))
        graph = context.evaluated_depsgraph_get()
        armature = _found(name)
        evaluated = armature.evaluated_get(graph)
        if not evaluated.is_evaluated:
            raise hidden(armature)
        if not row:
            reader = armature_reader.PoseReader(armature, rig.bones)
            binds = bind_places(context, armature, tracked, reader, rig.rest)
            graph = context.evaluated_depsgraph_get()
            evaluated = armature.evaluated_get(graph)
        joints[row] = reader.world(evaluated)
        places[""][row] = armature_reader.matrix(evaluated.matrix_world)
        for other in tracked:
            places[other][row] = world(_found(other), graph)
        values = [body_reader.shape_values(find(body)) for body in bodies]
        shapes.append(np.concatenate([np.zeros(0), *values]))
        yield row + 1, len(frames)
    rate, unit = scene.render.fps / scene.render.fps_base, scene.unit_settings.scale_length
    untrimmed = places[""][0] @ rig.rest
    motion = Motion.from_world(frames, rate, unit, rig.parents, untrimmed, joints, np.array(shapes), places, name)
    head = rig.humanoid()["head"]
    for other in tracked:
        own = rig_service.on_head(places[other], places[""], joints[:, head], untrimmed[head])
        binds[other] = binds[other] if own is None else own
    arrays = [(body_reader.read(find(body), armature), binds[body]) for body in bodies]
    metres = unit * rig_service.size_shown(rig, places[""][0], motion)
    character = rig_service.character(rig, places[""][0], arrays, metres)
    clip = motion.clip(to_core(unit), find(name).neuralocks_character.loop)
    before = session.rigs.get(name)
    if before is not None and rig_service.same(before.character, character):
        character = before.character
    trim = trim_of(untrimmed, name)
    drawn = (joints @ trim).astype(np.float32)
    sampled = SampledRig(rig, motion, character, clip, trim, key, binds, bind_metres=metres, drawn=drawn)
    session.renew_motion(name, sampled, reader)


def _found(name: str):
    """The object of this full name, while frames are stepped."""
    thing = find(name)
    if thing is None:
        raise NeuralocksError(f"{name}: it was deleted while the motion was sampled; start again")
    return thing


class stepping:
    """While frames are stepped: the live view is off, and the current frame comes back at the end, with poses that are
    not keyed.
    """

    def __init__(self, scene):
        self._scene = scene

    def __enter__(self):
        self._frame = self._scene.frame_current, self._scene.frame_subframe
        self._unkeyed = Unkeyed(self._scene)
        session.paused += 1

    def __exit__(self, *_):
        try:
            self._scene.frame_set(self._frame[0], subframe=self._frame[1])
            self._unkeyed.put_back()
        finally:
            session.paused -= 1


def ensure(context, armature) -> SampledRig:
    """The sampled motion, sampled now if there is none or it is stale."""
    found = session.rigs.get(armature.name_full)
    if found is None or found.stale or found.key != key_of(armature, context.scene):
        with stepping(context.scene):
            for _ in sample(context, armature):
                pass
        found = session.rigs[armature.name_full]
    return found
