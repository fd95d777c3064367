# SPDX-License-Identifier: GPL-3.0-or-later
"""The pose of a sampled armature as Blender draws it."""

import numpy as np

from neuralocks_core.errors import NeuralocksError

from ..scene.character.binding import hidden
from ..scene.drawing.clock import shown_frame
from ..scene.drawing.handler_order import others_called
from ..scene.keys.hair_keys import as_before
from ..scene.motion.dependencies import timing_of
from ..services.rigs.axes import to_core
from ..services.rigs.motion import as_carried, same_pose
from ..session import session


def pose(armature, sampled, scene, graph, moved: bool, body: bool = False) -> np.ndarray:
    """World joints (J, 4, 4) in the core's space: the sampled ones, bit for bit as the bake reads them, if the drawn pose is the
    sampled one; with `body`, also in all joints that move the body. In another pose, the joints that differ are as drawn.
    """
    evaluated = armature.evaluated_get(graph)
    if not evaluated.is_evaluated:
        raise hidden(armature)
    if tuple(armature.pose.bones.keys()) != sampled.reader.bones:
        session.forget_motion(armature.name_full)
        raise NeuralocksError(f"{armature.name_full}: its bones have changed; press Sample Motion")
    if moved and sampled.key.timing != timing_of(scene):
        sampled.stale = session.sampling.wanting = True
        if graph.mode == "RENDER":  # all scenes were sampled before the first was drawn
            _tell_misrendered(
                armature.name_full,
                f"hair may be wrong in the last render of scene '{scene.name}': it is rendered with other scenes that share the "
                "character, but not the frame range, the frame rate, Time Stretching or Samples; give them the same",
            )
    world = sampled.reader.world(evaluated) @ sampled.trim
    row = sampled.motion.row(shown_frame(scene))
    if row is not None:
        same = same_pose(world, sampled.drawn[row])
        # Hair bones that are live or baked do not count as body, nor do joints below them.
        if body and (turned := as_before(armature)):
            hair = (joint for joint, bone in enumerate(sampled.rig.bones) if bone in turned)
            same |= sampled.character.skeleton.below(*hair)
        if same[sampled.moving[body]].all():
            return sampled.clip.joints[row]
        if moved and graph.mode == "RENDER" and others_called():
            _tell_late(armature.name_full)
        elif moved:
            sampled.stale = session.sampling.wanting = True
            if graph.mode == "RENDER":
                _tell_misrendered(
                    armature.name_full,
                    f"hair may be wrong in the last render, from frame {shown_frame(scene):g} on, where the character moves otherwise "
                    "than when its motion was sampled; render again, and if that does not help, bake the simulation that moves it",
                )
    drawn = to_core(sampled.motion.metres_per_unit) @ world
    for joint in {sampled.character.head, *sampled.carriers.values()}:
        drawn[joint] = as_carried(drawn[joint], armature.name_full)
    if row is not None:
        drawn[same] = sampled.clip.joints[row, same]
    return drawn


def _tell_late(name: str) -> None:
    """Say, also on the console, that the render's pose is not the sampled one: poses set after a frame change are evaluated over
    the keys of the frame in view, too late for the hair.
    """
    message = (
        f"{name}: the render poses it differently from the view, so hair may be wrong; if a script poses it after each "
        "frame change (frame_change_post), make it do so before (frame_change_pre)"
    )
    if session.said.messages.get(name) != message:
        session.said.messages[name] = message
        print(f"Neuralocks: {message}")


def _tell_misrendered(name: str, fact: str) -> None:
    """Say, also on the console, that a render shows a character otherwise than it was sampled, of which nothing told before: its hair
    remembers the motion of before, also in later frames that are as they were.
    """
    if name not in session.said.misrendered:
        session.said.misrendered[name] = f"{name}: {fact}"
        print(f"Neuralocks: {session.said.misrendered[name]}")
