# SPDX-License-Identifier: GPL-3.0-or-later
"""The pose that is drawn, of a sampled armature."""

import numpy as np

from neuralocks_core.errors import NeuralocksError

from .scene.binding import hidden
from .scene.sampling import shown_frame, timing_of
from .services.axes import to_core
from .services.motion import TOLERANCE, as_carried
from .session import session


def pose(armature, sampled, scene, graph, moved: bool) -> np.ndarray:
    """World joints (J, 4, 4) in the core's space: the sampled ones where the pose drawn is the sampled one, bit for bit
    as the bake reads them.
    """
    evaluated = armature.evaluated_get(graph)
    if not evaluated.is_evaluated:
        raise hidden(armature)
    reader = session.readers.get(armature.name_full)
    if reader is None or tuple(armature.pose.bones.keys()) != reader.bones:
        session.forget_motion(armature.name_full)
        raise NeuralocksError(f"{armature.name_full}: its bones have changed; press Sample Motion")
    if moved and sampled.key[0] != timing_of(scene):
        sampled.stale = session.wanting = True
    world = reader.world(evaluated) @ sampled.trim
    row = sampled.motion.row(shown_frame(scene))
    if row is not None:
        # Only the joints that hair is moved by: hair bones of their own, say, may be live themselves.
        read = sorted(set(sampled.character.humanoid.values()))
        if np.abs(world[read] - sampled.drawn[row, read]).max() < TOLERANCE:
            return sampled.clip.joints[row]
        if moved:
            sampled.stale = session.wanting = True
    drawn = to_core(sampled.motion.metres_per_unit) @ world
    head = sampled.character.head
    drawn[head] = as_carried(drawn[head], armature.name_full)
    return drawn
