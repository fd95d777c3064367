# SPDX-License-Identifier: GPL-3.0-or-later
"""What an armature is found to be, kept for the panel and for records of bakes."""

import numpy as np

from neuralocks_core.errors import NeuralocksError

from ...services.rigs.rig import RigArrays
from ...session import session
from .armature import read
from .skinned import groups_of_skin


def examined(armature) -> tuple[RigArrays | None, int | None, str]:
    """What `armature.read` gives, and the head that is found in it; or None twice, and why. A rig is examined again only if another head may be
    found in it: that takes longer than a redraw may.
    """
    key, known = _found_by(armature), session.read.examined.get(armature.name_full)
    if known is None or known[0] != key:
        try:
            rig = read(armature, armature.neuralocks_character.head_bone)
            known = key, (rig, rig.humanoid["head"], "")
        except NeuralocksError as error:
            known = key, (None, None, str(error))
        session.read.examined[armature.name_full] = known
    return known[1]


def _found_by(armature) -> tuple:
    """The bones, what they are below, where they rest and whether they deform, the skin, and the choice of the head."""
    bones, chosen = armature.data.bones, armature.neuralocks_character.head_bone
    above = tuple(bone.parent.name if bone.parent else "" for bone in bones)
    deform = tuple(bone.use_deform for bone in bones)
    rest = np.empty(3 * len(bones), np.float32)
    bones.foreach_get("head_local", rest)
    return tuple(bones.keys()), above, rest.tobytes(), deform, groups_of_skin(armature), chosen
