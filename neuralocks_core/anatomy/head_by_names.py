# SPDX-License-Identifier: Apache-2.0
"""Which joint is the head by names and hierarchy: one named so, else one on the neck, else the end of a numbered spine."""

import re

import numpy as np

from neuralocks_core.anatomy.hierarchy import below, copies, depth
from neuralocks_core.anatomy.joint_names import leaf

_NOT_HEAD = ("end", "top", "nub", "gear", "fore", "band", "twist", "ctrl", "aim", "site")


def head_by_names(names, sides, keys, parents, positions=None, skinned=None) -> tuple[int, str] | None:
    """The head, and in words how it was found; None if no joint is named like one.

    Args:
        names, parents, positions, skinned: as for `humanoid.find_humanoid`.
        sides, keys: of each joint (J), as `joint_names.sides_and_keys` gives them.
    """
    middle = [joint for joint, side in enumerate(sides) if not side]
    head = _named(middle, keys, parents, positions, skinned)
    if head is not None:
        return head, f"by name '{leaf(names[head])}'"
    neck = max(
        (joint for joint in middle if "neck" in keys[joint]), key=lambda joint: depth(joint, parents), default=None
    )
    head = None if neck is None else _on_neck(neck, sides, keys, parents, positions)
    if head is not None:
        return head, f"child of the neck '{leaf(names[neck])}'"
    spine = [joint for joint in middle if keys[joint] == "spine"]
    if len(spine) < 5:
        return None
    head = _end_of(spine, names, parents, skinned)
    return head, f"last joint of the spine '{leaf(names[head])}'"


def _named(middle: list[int], keys, parents, positions, skinned) -> int | None:
    """Of joints that are named alike, one that moves skin, as it does if one below it does, or a copy of it; then the highest."""

    def named(joint: int) -> tuple:
        key = keys[joint]
        # XNALara's `head neck lower` is a neck, its `head neck upper` the head.
        return key != "head", not key.endswith("head"), "lower" in key

    def still(joint: int) -> bool:
        same = (joint, *copies(joint, parents, positions))
        return skinned is not None and not any(np.asarray(skinned)[below(each, parents)].any() for each in same)

    heads = [joint for joint in middle if "head" in keys[joint] and not _excluded(keys[joint].replace("head", ""))]
    best = min(map(named, heads), default=None)
    alike = (joint for joint in heads if named(joint) == best)
    return min(alike, key=lambda joint: (still(joint), depth(joint, parents), joint), default=None)


def _on_neck(neck: int, sides, keys, parents, positions) -> int | None:
    """Hair chains hang from necks too: the head is in the middle, and farthest along the neck."""
    at = None if positions is None else np.asarray(positions, float)

    def rank(joint: int) -> tuple:
        along = 0.0 if at is None or parents[neck] < 0 else (at[joint] - at[neck]) @ (at[neck] - at[parents[neck]])
        return bool(sides[joint]), _excluded(keys[joint]), -along, joint

    return min((joint for joint in range(len(keys)) if parents[joint] == neck), key=rank, default=None)


def _excluded(key: str) -> bool:
    """Whether a joint on the neck or with `head` in its name is something else."""
    return any(word in key for word in _NOT_HEAD)


def _end_of(spine: list[int], names, parents, skinned) -> int:
    """Rigify's deform bones number the whole trunk spine, spine.001 ... spine.006, the last of which is the head; an animal's begin
    with its tail. Exports of these keep bones of other layers with the same numbers, which move no skin themselves.
    """
    own = np.ones(len(names), bool) if skinned is None else skinned

    def rank(joint: int) -> tuple:
        return int("0" + re.search(r"\d{0,9}$", names[joint])[0]), own[joint], depth(joint, parents)

    return max(spine, key=rank)
