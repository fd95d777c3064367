# SPDX-License-Identifier: Apache-2.0
"""A standing rest pose for a skeleton that has none: how the body lies in each joint's axes, inferred from its motion.

A bone keeps its direction in its joint's axes. The direction across it follows from the joints to the left and right, and
from the hinge about which elbows and knees bend.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from neuralocks_core import rotation
from neuralocks_core.anatomy.humanoid import TRUNK, Humanoid

NEAR = 40.0
"""If the body's axes are this close to those of a joint [degrees], they are taken to be the same."""
SHORT = 0.05
"""Bones that are shorter than this share of the trunk give no direction."""
INSTEP = np.radians(20)
"""How steeply the line from ankle to toes descends when soles lie flat."""
BENT = 0.05
"""Elbows and knees that bend less on average (sine) do not reveal their hinge."""
_LEFT, _UP, _FRONT = np.eye(3)


def rest_from_motion(world: np.ndarray, parents, humanoid: Humanoid) -> np.ndarray | None:
    """World transforms (J, 4, 4) of a T-pose, Y up and facing +Z; None if left and right cannot be told apart.

    Args:
        world: transforms (T, J, 4, 4) of poses, Y up.
        parents: (J,) parent indices, -1 for roots.
        humanoid: which joints are which.
    """
    turns, places = world[..., :3, :3], world[..., :3, 3]
    across = _across(places, humanoid)
    if across is None:
        return None
    body = _trunk(turns, places, humanoid, *across)
    for side, sign in (("left", 1), ("right", -1)):
        arm = [f"{side}_{part}" for part in ("upper_arm", "lower_arm", "hand")]
        leg = [f"{side}_{part}" for part in ("upper_leg", "lower_leg", "foot")]
        body |= _limb(turns, places, humanoid, arm, sign * _LEFT)
        body |= _limb(turns, places, humanoid, leg, -_UP, _toes(places, parents, humanoid.get(leg[-1])))
        body |= _collar(turns, places, humanoid, side, sign * _LEFT)
    rest = np.tile(np.eye(4), (len(parents), 1, 1))
    for joint, parent in enumerate(parents):
        if joint in body:
            rest[joint, :3, :3] = body[joint].T
        elif parent >= 0:
            follows = _rotation(np.mean(np.swapaxes(turns[:, parent], -1, -2) @ turns[:, joint], axis=0))
            rest[joint, :3, :3] = rest[parent, :3, :3] @ follows
        if parent >= 0:
            bone = _in_joint(turns[:, parent], places[:, joint] - places[:, parent])
            rest[joint, :3, 3] = rest[parent, :3, 3] + rest[parent, :3, :3] @ bone
    return rest


def _across(places: np.ndarray, humanoid: Humanoid) -> tuple[np.ndarray, np.ndarray] | None:
    """Directions (T, 3) from right to left, across the hips and across the shoulders."""
    found = []
    for parts in (("upper_leg", "lower_leg"), ("upper_arm", "shoulder")):
        ends = [(humanoid.get(f"left_{part}"), humanoid.get(f"right_{part}")) for part in parts]
        ways = [places[:, left] - places[:, right] for left, right in ends if None not in (left, right)]
        ways = [way for way in ways if np.linalg.norm(way, axis=1).min() > 1e-6]
        found.append(ways[0] / np.linalg.norm(ways[0], axis=1, keepdims=True) if ways else None)
    low, high = found
    if low is None and high is None:
        return None
    return (high if low is None else low, low if high is None else high)


def _trunk(turns, places, humanoid: Humanoid, low: np.ndarray, high: np.ndarray) -> dict[int, np.ndarray]:
    """Joint -> the body's axes (3, 3) in the joint's own axes, as columns: left, up, front."""
    names = [name for name in TRUNK if name in humanoid]
    trunk = list(dict.fromkeys(humanoid[name] for name in names))
    way = places[:, trunk]
    least = SHORT * np.linalg.norm(way[:, -1] - way[:, 0], axis=1).mean()
    body = {}
    for name in reversed(names):  # if a joint has several names, the lowest counts
        joint = humanoid[name]
        across = low if name == "hips" else low + high if name in ("spine", "chest") else high
        rank = trunk.index(joint)
        ways = [way[:, i] - way[:, rank] for i in range(rank + 1, len(trunk))]
        ways += [way[:, rank] - way[:, i] for i in reversed(range(rank))]
        bone = next((each for each in ways if np.linalg.norm(each, axis=1).mean() > least), ways[0])
        body[joint] = _axes(turns[:, joint], bone, across, _UP, _LEFT)
    return body


def _limb(turns, places, humanoid: Humanoid, names: list[str], along: np.ndarray, toes=None) -> dict[int, np.ndarray]:
    """The same for the joints of an arm or a leg that lies along a direction (3,) in a T-pose; `toes` is the joint of the toes."""
    if any(name not in humanoid for name in names):
        return {}
    upper, lower, end = (humanoid[name] for name in names)
    first, second = places[:, lower] - places[:, upper], places[:, end] - places[:, lower]
    size = np.linalg.norm(first, axis=1, keepdims=True) * np.linalg.norm(second, axis=1, keepdims=True)
    hinge = np.cross(first, second) / np.maximum(size, 1e-12)
    # Elbows bend to the front, knees to the back.
    across = np.cross(along, _FRONT if along[1] == 0 else -_FRONT)
    if np.linalg.norm(_in_joint(turns[:, upper], hinge)) < BENT:
        hinge = rotation.between(along, first + 1e-12 * along) @ across
    body = {upper: _axes(turns[:, upper], first, hinge, along, across)}
    above, bone_above = upper, first
    for joint in (lower, end):
        here, there = _in_joint(turns[:, joint], second), _in_joint(turns[:, above], bone_above)
        if joint == end and toes is not None:
            way = places[:, toes] - places[:, end]
            down = np.cos(INSTEP) * _FRONT - np.sin(INSTEP) * _UP
            body[joint] = _between(turns[:, joint], way, turns[:, lower] @ body[lower] @ across, down, across)
        elif _angle(here, there) < NEAR:
            # Both bones run along the same axis of their joints, so the axes across agree, too: forearms twist.
            body[joint] = body[above]
        else:
            body[joint] = _axes(turns[:, joint], second, hinge, along, across)
        above, bone_above = joint, second
    return body


def _toes(places: np.ndarray, parents, foot: int | None) -> int | None:
    """The joint below a foot that is farthest from it, if any is away from it."""
    below = [joint for joint, parent in enumerate(parents) if parent == foot]
    far = {joint: np.linalg.norm(places[:, joint] - places[:, foot], axis=1).min() for joint in below}
    toes = max(far, key=far.get, default=None)
    return toes if toes is not None and far[toes] > 1e-6 else None


def _collar(turns, places, humanoid: Humanoid, side: str, along: np.ndarray) -> dict[int, np.ndarray]:
    collar, arm = humanoid.get(f"{side}_shoulder"), humanoid.get(f"{side}_upper_arm")
    if None in (collar, arm):
        return {}
    up = places[:, humanoid["head"]] - places[:, humanoid["hips"]]
    return {collar: _axes(turns[:, collar], places[:, arm] - places[:, collar], up, along, _UP)}


def _axes(turns, bone, across, body_bone, body_across) -> np.ndarray:
    """The same as `_between`, or the joint's own nearest axes if these are close."""
    axes = _between(turns, bone, across, body_bone, body_across)
    quarters = Rotation.create_group("O")
    off = np.degrees((quarters.inv() * Rotation.from_matrix(axes)).magnitude())
    return quarters[int(off.argmin())].as_matrix().round() if off.min() < NEAR else axes


def _between(turns, bone, across, body_bone, body_across) -> np.ndarray:
    """The body's axes in a joint's own (3, 3), columns, from two world directions (T, 3) and their T-pose directions."""
    return _frame(_in_joint(turns, bone), _in_joint(turns, across)) @ _frame(body_bone, body_across).T


def _in_joint(turns: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """The mean (3,) of directions (T, 3) as seen from a joint that turns by (T, 3, 3)."""
    return np.einsum("tij,ti->j", turns, ways) / len(turns)


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    """Angle [degrees] between two directions (3,)."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def _frame(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Rotation (3, 3) whose first column goes along one direction (3,), its second in the plane of both."""
    first = first / np.linalg.norm(first) if first.any() else _LEFT
    third = np.cross(first, second)
    if np.linalg.norm(third) < 1e-9:  # no plane: any direction will do
        third = np.cross(first, np.eye(3)[np.abs(first).argmin()])
    third = third / np.linalg.norm(third)
    return np.stack([first, np.cross(third, first), third], axis=1)


def _rotation(matrix: np.ndarray) -> np.ndarray:
    """The rotation nearest to a mean of rotations (3, 3)."""
    left, _, right = np.linalg.svd(matrix)
    left[:, 2] *= np.sign(np.linalg.det(left @ right))
    return left @ right
