# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of bones as joint paths, of objects as names of prims."""

import re

import numpy as np


def identifier(name: str) -> str:
    """`name` with only letters, digits and underscores, not beginning with a digit."""
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name) or "_"
    return f"_{plain}" if plain[0].isdigit() else plain


def joint_identifier(name: str) -> str:
    """`name` as the last part of a joint path: with letters of all scripts, because a rig's words say which bone is which, also in
    Japanese. A prim's name is plain ASCII, since USD before 24.03 takes nothing else.
    """
    kept = "".join(c if (c.isalpha() or c.isdecimal()) and f"_{c}".isidentifier() else "_" for c in name) or "_"
    return kept if kept[0].isidentifier() else f"_{kept}"


LONGEST = 100
"""Bytes of an object's name that are used in a file's name; no file system takes the longest names."""


def file_label(name: str) -> str:
    """`name` as a part of a file's name: with letters of all scripts, because a plain name would be the same for many."""
    label = "".join(c if c.isalnum() else "_" for c in name)
    return label.encode()[:LONGEST].decode(errors="ignore")


BONE = 63
"""Bytes of the longest names of bones; Blender's own exporter keeps all of them."""


def unique(names: list[str], made=identifier) -> list[str]:
    """Identifiers of `names`, each different from all others (Blender reads only the last part of a joint path)."""
    taken: set[str] = set()
    result = []
    for name in names:
        base = made(name)
        candidate, number = _cut(base), 1
        while candidate in taken:
            number += 1
            candidate = _cut(base, f"_{number}")
        taken.add(candidate)
        result.append(candidate)
    return result


def _cut(name: str, end: str = "") -> str:
    """A name with this end, in as many bytes as a bone's may have."""
    return name.encode()[: BONE - len(end)].decode(errors="ignore") + end


def joint_paths(bones: list[str], parents: list[int]) -> list[str]:
    """Joint paths (J) of bones listed parents first."""
    paths: list[str] = []
    for leaf, parent in zip(unique(bones, joint_identifier), parents, strict=True):
        paths.append(leaf if parent < 0 else f"{paths[parent]}/{leaf}")
    return paths


def parents_first(parents: list[int]) -> np.ndarray:
    """An order (J,) in which every parent comes before its children, otherwise as given."""
    order, placed = [], set()

    def place(joint: int) -> None:
        way = []
        while joint >= 0 and joint not in placed:
            way.append(joint)
            joint = parents[joint]
        for step in reversed(way):
            placed.add(step)
            order.append(step)

    for joint in range(len(parents)):
        place(joint)
    return np.array(order, int)
