# SPDX-License-Identifier: GPL-3.0-or-later
"""Where an object stands."""

import numpy as np

from ..drawing.hidden_objects import evaluated_for_itself
from .armature import matrix


def world(thing, graph) -> np.ndarray:
    """World transform (4, 4) of an object as `graph` has it. Blender may leave hidden or excluded objects where they were in
    another frame, without telling: their place then comes from their parent's, if nothing else moves them.
    """
    evaluated, plain = thing.evaluated_get(graph), not len(thing.constraints) and thing.animation_data is None
    if evaluated.is_evaluated and (evaluated_for_itself(thing, graph) or not plain):
        return matrix(evaluated.matrix_world)
    own, parent = matrix(thing.matrix_basis), thing.parent
    if parent is None:
        return own
    place = world(parent, graph)
    pose = parent.evaluated_get(graph).pose
    bone = pose.bones.get(thing.parent_bone) if pose and thing.parent_type == "BONE" else None
    if bone is not None:  # bone parents count from the tail
        tail = np.eye(4)
        tail[1, 3] = bone.bone.length
        place = place @ matrix(bone.matrix) @ tail
    return place @ matrix(thing.matrix_parent_inverse) @ own
