# SPDX-License-Identifier: Apache-2.0
"""Motion of a character whose animation scales the head, as a head that keeps its size sees it."""

import numpy as np

from neuralocks_core.character import Character
from neuralocks_core.rotation import rotation_part


def unscaled(character: Character, joints: np.ndarray) -> np.ndarray:
    """World joint transforms (T, J, 4, 4) as seen by a head that keeps its size: like the network, the solver works on hair at
    its rest length, whatever size the animation gives the head.

    Raises:
        NeuralocksError: the head is mirrored, flat or not finite.
    """
    head = character.canonical_to_world(joints)
    rigid = head.copy()
    rigid[:, :3, :3] = rotation_part(head, "head")
    return (rigid @ np.linalg.inv(head))[:, None] @ joints
