# SPDX-License-Identifier: Apache-2.0
"""Where the uneven scale of hair joints in the bind pose comes from: the joints, or a prim above the skeleton."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig.measuring import UNEVEN, UnevenJoint

from ..shot.notes.character_notes import uneven
from ..skel.stage_rig import StageRig


@contextmanager
def names_uneven_prims(stage_rig: StageRig) -> Iterator[None]:
    """Turns an error about a joint that is scaled unevenly into one that names the prim above, if that has the scale."""
    try:
        yield
    except UnevenJoint:
        placed = stage_rig.joints.placement
        if not _uneven(placed.reference):
            raise
        raise NeuralocksError(
            f"{stage_rig.path}: {placed.whose(_uneven)} is scaled unevenly, and hair joints below it cannot be; "
            "scale it evenly, or apply its scale to skeleton and meshes"
        ) from None


def _uneven(transform: np.ndarray) -> bool:
    return uneven(transform, UNEVEN)
