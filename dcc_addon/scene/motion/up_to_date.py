# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a sampled motion is still what Blender shows, and sampling it again if not."""

from ...sampled_rig import SampledRig
from ...services.rigs.motion import same_pose
from ...session import session
from ..character.carried import hairs_of
from ..character.layers import layer_of, working_in
from ..objects.lookup import named
from .dependencies import edited_unseen, key_of, posture_of, rigging_of
from .sampling import in_slices
from .stepping import step, stepping


def ensure(context, armature) -> SampledRig:
    """The sampled motion, sampled now if there is none, if it is stale, or if some of its frames are not as they were."""
    found = known(armature, context.scene)
    if found is None or not _as_sampled(context, armature, found):
        for _ in in_slices(context, armature):
            pass
        found = session.rigs[armature.name_full]
    return found


def known(armature, scene) -> SampledRig | None:
    """The sampled motion if there is one that is not out of date, also by what `notice` finds."""
    notice(armature, scene)
    return current(armature, scene)


def current(armature, scene) -> SampledRig | None:
    """The sampled motion if there is one that is not known to be out of date."""
    found = session.rigs.get(armature.name_full)
    return found if found is not None and not found.stale and found.key == key_of(armature, scene) else None


def _as_sampled(context, armature, sampled: SampledRig) -> bool:
    """Whether the first frame, the last one and one between show the armature as it was sampled: Blender does not report much of
    what moves a rig, and no list of it is complete.
    """
    scene, name, frames = context.scene, armature.name_full, sampled.motion.frames
    read = sampled.moving[any(hair.neuralocks_hair.resolve for hair in hairs_of(armature, scene))]
    with stepping(scene):
        for row in {0, len(frames) // 2, len(frames) - 1}:
            step(scene, frames[row])
            layer = layer_of(named(name), scene)
            if layer is None:  # reported where hair is moved
                return True
            with working_in(scene, layer):
                evaluated = named(name).evaluated_get(context.evaluated_depsgraph_get())
                drawn = (sampled.reader.world(evaluated) @ sampled.trim)[read]
            if not same_pose(drawn, sampled.drawn[row, read]).all():
                return False
    return True


def notice(armature, scene) -> None:
    """Check whether a sampled motion is out of date although no action was edited: strips, drivers or constraints changed, or
    unkeyed values, which count in all frames.
    """
    sampled = session.rigs.get(armature.name_full)
    if sampled is not None and not sampled.stale:
        sampled.stale = (
            sampled.rigging != rigging_of(armature, scene)
            or sampled.posture != posture_of(armature, scene)
            or edited_unseen(armature, scene, sampled.unreported)
        )
