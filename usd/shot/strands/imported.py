# SPDX-License-Identifier: Apache-2.0
"""Curves that Blender has imported with their motion: it gives them the points of time code 0, not those at rest."""

import numpy as np
from pxr import Sdf, UsdGeom

from neuralocks_core.errors import NeuralocksError

from ...border.stage_files import open_stage
from ...border.values import as_numbers
from .curves import moment, rest_points

IMPORTED = 0.0
"""The time code that Blender 4.2 to 5.2 import, whatever the current frame, or the first frame of the file."""


def imported_and_rest(path: str, prim_path: str) -> tuple[np.ndarray, np.ndarray]:
    """Points (P, 3) float32 of a groom as they are imported, and at rest, in its own space and units.

    Raises:
        NeuralocksError: the file cannot be read, has no such groom, or has no rest shape of it.
    """
    stage = open_stage(path)
    prim = stage.GetPrimAtPath(prim_path) if Sdf.Path.IsValidPathString(prim_path) else None
    if not prim or not prim.IsA(UsdGeom.PointBased):
        raise NeuralocksError(f"{path}: it has no hair {prim_path}")
    rest = rest_points(prim)
    if moment(prim) is not None:
        raise NeuralocksError(f"{path}: it has only moved points of {prim_path}, none at rest")
    points = UsdGeom.PointBased(prim).GetPointsAttr()
    return as_numbers(points, "point3f[]", points.Get(IMPORTED), np.float32), rest
