# SPDX-License-Identifier: Apache-2.0
"""Parents of a skeleton's joints, which UsdSkel tells by their paths."""

from collections.abc import Sequence

import numpy as np
from pxr import Sdf

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.errors import NeuralocksError


def joint_parents(skeleton: str, names: Sequence[str]) -> np.ndarray:
    """The parent (J,) int of each joint, -1 for a root: the nearest joint above its path.

    Args:
        skeleton: path of the prim, for messages.
        names: joint paths (J).

    Raises:
        NeuralocksError: a name is not a path, is there twice, or comes before its parent's.
    """
    seen: dict[str, int] = {}
    parents = []
    for index, name in enumerate(names):
        if not Sdf.Path.IsValidPathString(name):
            raise NeuralocksError(f"{skeleton}: joint {index} is named '{name}', which is not a path; rename it")
        if name in seen:
            # Exporters replace each letter that they do not take with '_': all names of a Japanese rig become alike.
            lost = not any(letter.isalnum() for letter in leaf(name))
            remedy = "export it with Unicode names allowed, or rename its bones" if lost else "make joint paths unique"
            raise NeuralocksError(f"{skeleton}: joint '{name}' is listed twice; {remedy}")
        above = Sdf.Path(name).GetParentPath()
        while (
            not above.isEmpty
            and above not in (Sdf.Path.reflexiveRelativePath, Sdf.Path.absoluteRootPath)
            and str(above) not in seen
        ):
            if str(above) in names:
                raise NeuralocksError(f"{skeleton}: joint '{name}' comes before its parent; list parents first")
            above = above.GetParentPath()
        parents.append(seen.get(str(above), -1))
        seen[name] = index
    return np.array(parents, int)
