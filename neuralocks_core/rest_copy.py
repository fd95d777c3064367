# SPDX-License-Identifier: Apache-2.0
"""The copy of a groom's rest points beside points that Blender's live view has moved: an attribute of the curves there,
and a primvar if Blender's own exporter has written them as USD.
"""

import numpy as np

NAME = "neuralocks_rest"


def never_written(values: np.ndarray) -> np.ndarray:
    """Which points (P,) of a copy (P, 3) were never written: zeros, with which added points fill all attributes. A point that
    rests at the origin is stored with a negative zero first.
    """
    return ~(values.any(axis=1) | np.signbit(values[:, 0]))
