# SPDX-License-Identifier: GPL-3.0-or-later
"""Where hair and body stand in the bind pose, and which bone carries a rigid one."""

from contextlib import contextmanager

import bpy
import numpy as np

from neuralocks_core.errors import NeuralocksError

from ..objects.lookup import find
from .armature import matrix
from .placing import world

CARRYING = {"ARMATURE", "CHILD_OF", "COPY_LOCATION", "COPY_TRANSFORMS"}
"""Constraints by which an object goes where a bone goes; others turn it, or hold it at a distance."""


def bind_places(context, armature, names, reader, rest: np.ndarray) -> dict[str, np.ndarray]:
    """World transforms (4, 4) of objects, by full name, as they are when the rig that carries them is in its rest pose
    and the armature object stands where it does now.

    Blender itself is asked, because hair may follow a bone in many ways: as a direct or indirect child, by constraints, or by
    another armature that moves this one.

    Args:
        context: of Blender.
        armature, reader, rest: the armature object, its `PoseReader`, and its rest pose (J, 4, 4) in its own space.
        names: of the objects.

    Raises:
        NeuralocksError: Blender does not move the armature.
    """
    things = [find(name) for name in names]
    here = world(armature, context.evaluated_depsgraph_get())
    with at_rest(context, armature, *things):
        _animate(context.scene)
        graph = context.evaluated_depsgraph_get()
        evaluated = armature.evaluated_get(graph)
        expected = matrix(evaluated.matrix_world) @ rest
        if not np.allclose(reader.world(evaluated), expected, rtol=1e-3, atol=1e-3 * np.abs(expected).max()):
            raise hidden(armature)
        # An armature attached to a bone of another one has moved too.
        back = here @ np.linalg.inv(world(armature, graph))
        found = {thing.name_full: back @ world(thing, graph) for thing in things}
    _animate(context.scene)
    return found


def _animate(scene) -> None:
    """Evaluate the animation of the frame once more: before 4.0, an edit undoes it in view layers that are not in view."""
    if bpy.app.version < (4, 0):
        scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)


def hidden(armature) -> NeuralocksError:
    """The error for an armature that is not evaluated, or not posed."""
    if armature.mode == "EDIT":
        return NeuralocksError(f"{armature.name_full}: its bones are being edited; leave Edit Mode")
    return NeuralocksError(
        f"{armature.name_full}: the armature is hidden or in an excluded collection; show it so that it is evaluated"
    )


@contextmanager
def at_rest(context, *things):
    """In this block, all armatures that these objects depend on, and these themselves, are in their rest poses."""
    kept = [(a.data, a.data.pose_position) for a in {a for thing in things for a in armatures_of(thing)}]
    try:
        for data, _ in kept:
            data.pose_position = "REST"
        context.view_layer.update()
        yield
    finally:
        for data, position in reversed(kept):
            data.pose_position = position
        context.view_layer.update()


def carrier(thing, shown):
    """The armature that moves an object, or deforms it: the one `shown`, unless it does not and another does."""
    moving = armatures_of(thing)
    if not moving or shown in moving:
        return shown
    return [*deforming(thing), *sorted(moving, key=lambda armature: armature.name_full)][0]


def carrying_bone(thing, armature) -> str | None:
    """The bone of an armature that an object rides on as a whole, if there is one."""
    if thing.parent == armature and thing.parent_type == "BONE":
        return thing.parent_bone
    if (bone := _followed(thing, armature)) is not None:
        return bone
    return carrying_bone(thing.parent, armature) if thing.parent is not None else None


def followers(other, armature) -> dict[str, str]:
    """Which bone of an armature each bone of another one follows, by name, as a face's root follows a head; those of bones below one
    are not among them.
    """
    bones = other.pose.bones if other != armature and other.pose else ()
    return {bone.name: to for bone in bones if bone.constraints and (to := _followed(bone, armature)) is not None}


def _followed(thing, armature) -> str | None:
    """The bone of an armature that the constraints of an object, or of another's bone, follow."""
    for constraint in thing.constraints:
        for target in _targets(constraint) if constraint.type in CARRYING and not constraint.mute else ():
            if target.target == armature and target.subtarget:
                return target.subtarget
    return None


def deforming(thing) -> list:
    """The armatures that deform an object."""
    return [modifier.object for modifier in thing.modifiers if modifier.type == "ARMATURE" and modifier.object]


def apart_at_rest(thing, armature) -> bool:
    """Whether an object rides on another armature that only constraints of its bones join to this one: these do not count in the rest
    pose, so its place there means nothing.
    """
    others = armatures_of(thing) - {armature}
    joined = (other for other in others if any(armature in armatures_of(t.target) for t in _bone_targets(other)))
    return any(armature not in armatures_of(other) for other in joined)


def armatures_of(thing) -> set:
    """Armatures on whose pose an object's place, or its shape, depends; an armature on its own."""
    return _reached(thing, set())


def _reached(thing, seen: set) -> set:
    if thing is None or thing in seen:
        return set()
    seen.add(thing)
    found = {thing} if thing.type == "ARMATURE" else set()
    found |= {*deforming(thing)}
    for constraint in thing.constraints:
        for target in _targets(constraint):
            found |= _reached(target.target, seen)
    return found | _reached(thing.parent, seen)


def _bone_targets(armature) -> list:
    constraints = (constraint for bone in armature.pose.bones for constraint in bone.constraints)
    return [target for constraint in constraints for target in _targets(constraint)]


def _targets(constraint) -> list:
    """Whatever has `target` and `subtarget`: the constraint itself, or its targets if it has several, the strongest first."""
    if hasattr(constraint, "targets"):
        return sorted(constraint.targets, key=lambda target: -target.weight)
    return [constraint] if hasattr(constraint, "target") else []
