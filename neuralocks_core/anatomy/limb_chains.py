# SPDX-License-Identifier: Apache-2.0
"""Elbow and hand, or knee and foot, if names tell only where the limb begins: found by hierarchy from there on."""

import numpy as np

WHOLE = ("arm", "leg")
"""Names of a whole limb, whose joints are numbered along it. Joints numbered under any other name divide one bone."""
PARTS_OF_A_BONE = ("twist", "roll")
"""Words of joints between the two ends of one bone."""
_APART = 1e-6
"""Joints closer together than this share of the skeleton's size count as at the same place."""


def below_first(first: int, end: int | None, keys, parents, positions, taken) -> tuple[int | None, int | None]:
    """Start and end joint of a limb's second bone; None if missing.

    Args:
        first: start joint of its first bone.
        end: end joint of the second bone, if known.
        keys: names of the joints without numbers and side (J).
        parents: (J,) parent indices, -1 for roots.
        positions: bind positions (J, 3), or None.
        taken: joints that are something else.
    """
    at = None if positions is None else np.asarray(positions, float)
    second = _next(first, end, keys, parents, at, taken)
    if second is None or end is not None:
        return second, end
    return second, _next(second, None, keys, parents, at, taken)


def _next(joint: int, end: int | None, keys, parents, at: np.ndarray | None, taken) -> int | None:
    """Start joint of the next bone: the next joint of the same name if that names a whole limb, else the first on the way to the
    end, or to the farthest joint.
    """
    depth = _depths_below(joint, parents)
    if not depth:
        return None
    least = 0.0 if at is None else _APART * np.linalg.norm(np.ptp(at, axis=0))

    def reach(other: int) -> float:
        return float(depth[other] if at is None else np.linalg.norm(at[other] - at[joint]))

    def begins_a_bone(other: int) -> bool:
        part = any(word in keys[other] for word in PARTS_OF_A_BONE)
        return not part and other not in taken and reach(other) > least

    numbered = [other for other in depth if keys[other] == keys[joint] and begins_a_bone(other)]
    if numbered and keys[joint] in WHOLE:
        return min(numbered, key=lambda other: (depth[other], other))
    way = [end if end in depth else max(depth, key=reach)]
    while way[-1] != joint:
        way.append(int(parents[way[-1]]))
    way = [other for other in way[-2::-1] if other != end and begins_a_bone(other)]
    other_bone = (other for other in way if not keys[joint] or keys[other] != keys[joint])
    return next(other_bone, way[0] if way else None)


def _depths_below(joint: int, parents) -> dict[int, int]:
    """Depth of each descendant below a joint."""
    depth = {}
    for other in range(len(parents)):
        up, steps = other, 0
        while up >= 0 and up != joint:
            up, steps = int(parents[up]), steps + 1
        if up == joint and steps:
            depth[other] = steps
    return depth
