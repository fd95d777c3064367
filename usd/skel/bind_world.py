# SPDX-License-Identifier: Apache-2.0
"""The bind pose in the world: which way is up in it, how large it is, and where it is shown."""

import numpy as np
from pxr import UsdGeom

from neuralocks_core.anatomy.humanoid import Humanoid
from neuralocks_core.anatomy.standing import standing
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import inverses, sizes, sizes_shown

from ..border.placement import Placement
from ..border.units import Border
from .binding import lineage
from .joints import JointSource

ALIKE = 1e-4
"""Places that are no farther apart are one; see `_apart`."""
LEAST = 1e-6
"""Less than this times the size in the bind pose counts as no size."""


def to_bind_world(source: JointSource, border: Border, posed: np.ndarray, humanoid: Humanoid) -> np.ndarray:
    """Authored bind space to bind world [m], (4, 4).

    Bind transforms are meant in world space, yet skinning takes them as the skeleton's own space, and files of both
    kinds exist. They differ where the skeleton's parents scale or turn. The size is taken from what skinning makes of
    the head, so that the head carries the groom without scaling; the axes are those in which the character stands
    upright.

    Args:
        source: the skeleton.
        border: the stage's units.
        posed: its joints (T, J, 4, 4) in the stage.
        humanoid: which of them is the head.

    Raises:
        NeuralocksError: the character is mirrored, or its head has no size.
    """
    placed = source.placement.reference[:3, :3]
    if _mirrors(source.placement.reference):
        raise NeuralocksError(_mirrored(source))
    head = humanoid.get("head", 0)
    shown = sizes_shown(posed[:, head], source.bind[head])
    if (shown < 0).any():
        later = next((code for code in source.placement.samples if _mirrors(source.placement.at(code))), None)
        raise NeuralocksError(
            f"{source.path}: joint '{source.names[head]}' is mirrored by its animation; "
            "apply or remove the negative scale"
            if later is None
            else _mirrored(source, later)
        )
    if np.median(shown) < LEAST:
        raise NeuralocksError(_flat(source, posed[np.abs(sizes(posed[:, head])).argmin()], head))
    ratio = np.median(shown) / sizes(placed)
    if abs(ratio - 1) < 1e-4:
        ratio = 1.0
    up = border.to_core[1, :3] / np.linalg.norm(border.to_core[1, :3])
    result = np.eye(4)
    result[:3, :3] = standing(placed, source.bind[:, :3, 3], humanoid, up) * ratio
    return border.to_core @ result


def bind_shown(source: JointSource) -> np.ndarray:
    """Where USD shows at rest what lies in the authored bind space, (4, 4): bind transforms may be in the skeleton's own space, or in the
    world's as USD means them, which differ where its prim is moved. If the rest pose shows them neither there nor where a prim above, as
    a reference to a whole file, puts that world, it is another pose, and they are taken as the skeleton's own.
    """
    own, bind = source.placement.reference, source.bind
    solid = np.abs(np.linalg.det(bind[:, :3, :3])) > np.finfo(float).tiny
    shown, reach = source.at_rest[solid] @ inverses(bind[solid]), 1 + np.abs(bind[:, :3, 3]).max()
    if not len(shown) or _apart(shown, shown[0], reach).max() > ALIKE or _apart(own, shown[0], reach) <= ALIKE:
        return own
    above = (prim for prim in lineage(source.prim.GetParent()) if prim.IsA(UsdGeom.Xformable))
    worlds = [np.eye(4), *(Placement(prim).reference for prim in above)]
    return shown[0] if _apart(np.array(worlds), shown[0], reach).min() <= ALIKE else own


def _apart(places: np.ndarray, place: np.ndarray, reach: float) -> np.ndarray:
    """How far places (..., 4, 4) are from one of them, in turn and size and as a share of the skeleton's reach, (...)."""
    off = np.abs(places - place)[..., :3, :] / [1, 1, 1, reach]
    return off.max(axis=(-2, -1)) / np.abs(place[:3, :3]).max()


def _mirrors(transform: np.ndarray) -> bool:
    """Whether a transform (4, 4) turns left into right."""
    return np.linalg.det(transform[:3, :3]) < 0


def _mirrored(source: JointSource, time_code: float | None = None) -> str:
    when = "" if time_code is None else f" at time code {time_code:g}"
    whose = source.placement.whose(_mirrors, time_code)
    return f"{source.path}: {whose} is mirrored{when} (negative scale); apply or remove the negative scale"


def _flat(source: JointSource, posed: np.ndarray, head: int) -> str:
    """What gives the head no size in a pose (J, 4, 4): the uppermost joint that has none, and its scale."""
    size, joint = sizes(posed @ np.linalg.inv(source.bind)), head
    while (above := source.parents[joint]) >= 0 and size[above] < LEAST:
        joint = above
    parent = posed[above] if above >= 0 else np.eye(4)
    scale = np.linalg.norm(np.linalg.solve(parent, posed[joint])[:3, :3], axis=0)
    return (
        f"{source.path}: joint '{source.names[joint]}' is scaled to {' x '.join(f'{each:.2g}' for each in scale)} in most of its "
        "animation, so that nothing is left of its head; leave it at 1, and hide meshes instead"
    )
