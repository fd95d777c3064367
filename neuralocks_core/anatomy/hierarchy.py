# SPDX-License-Identifier: Apache-2.0
"""Joints above and below another one, by the parents (J,) of a skeleton, -1 for roots; and joints in the same place beside it."""

import numpy as np

COPIED = 1e-4
"""Joints nearer to each other than this share of the rig's size are in the same place."""


def ancestors(joint: int, parents) -> list[int]:
    """A joint and its ancestors, up to the root."""
    way = []
    while joint >= 0:
        way.append(int(joint))
        joint = parents[joint]
    return way


def depth(joint: int, parents) -> int:
    """Number of joints above a joint."""
    return len(ancestors(joint, parents)) - 1


def below(joint: int, parents) -> list[int]:
    """A joint and all below it."""
    found = {joint}
    found.update(other for other, parent in enumerate(parents) if parent in found)  # parents come first
    return sorted(found)


def copies(joint: int, parents, positions) -> list[int]:
    """Other joints in the same bind place (J, 3) that are neither above nor below a joint: control rigs have several of a bone."""
    if positions is None:
        return []
    places = np.asarray(positions, float)
    near = np.linalg.norm(places - places[joint], axis=1) < COPIED * np.ptp(places, axis=0).max()
    near[ancestors(joint, parents)] = near[below(joint, parents)] = False
    return np.flatnonzero(near).tolist()
