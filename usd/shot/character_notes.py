# SPDX-License-Identifier: Apache-2.0
"""Notes on a character as it was bound: whether it stands."""

import numpy as np
from pxr import UsdGeom

from neuralocks_core.anatomy.standing import lies

from ..skel.source import StageRig


def lies_down(rig: StageRig) -> list[str]:
    """The note on a character that lies in its bind pose, as one does that counts another axis as up than its stage."""
    character = rig.character
    lying, sure = lies(character.skeleton.bind[:, :3, 3], character.humanoid, np.array([0.0, 1.0, 0.0]))
    foreign = rig.border.foreign(rig.source.prim.GetAttribute("bindTransforms"), axis_only=True)
    unsaid = not rig.source.prim.GetStage().HasAuthoredMetadata(UsdGeom.Tokens.upAxis)
    if not lying or not (sure or foreign or unsaid):
        return []
    up = rig.border.up_axis
    guess = f"the stage has no upAxis, so {up} is up: author it" if unsaid else f"if it stands, check upAxis ({up})"
    return [f"{rig.path}: lies down in its bind pose, so its hair is taken to hang sideways{foreign or f'; {guess}'}"]
