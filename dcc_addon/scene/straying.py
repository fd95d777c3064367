# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair objects that move otherwise than the head: as a child of the jaw, by keys of their own. Live hair and bakes stay on the
head bone whatever their object does.
"""

import numpy as np

from ..services import rig as rig_service
from . import curves

FAR = 0.01
"""Less is not told [m]."""


def told(hair, places: np.ndarray, carriers: list[np.ndarray], metres: float) -> str:
    """What to say of a hair object, empty where it goes with one of its carriers.

    Args:
        hair: the hair object.
        places: where it stands, world transforms (T, 4, 4).
        carriers: the same of what hair may hang on, though the head carries it.
        metres: of Blender's unit.
    """
    points, shown = curves.points(hair.data), np.abs(np.linalg.det(places)) > 0
    if not len(points) or not shown.any() or hair.parent_type.startswith("VERTEX"):  # skin is followed strand by strand
        return ""
    path = places[shown, :3, :3] @ points.mean(axis=0, dtype=float) + places[shown, :3, 3]
    far = metres * rig_service.strays(path, [carrier[shown] for carrier in carriers])
    if not far >= FAR:
        return ""
    return (
        f"{hair.name_full}: its object moves up to {1000 * far:.0f} mm against the head, which live hair and bakes do not "
        "follow: they stay on the head bone; if all hair rides on another bone, choose that as Head bone"
    )
