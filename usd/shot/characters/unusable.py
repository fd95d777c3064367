# SPDX-License-Identifier: Apache-2.0
"""Skeletons that cannot be used, and the hair on their characters: without a binding it may be near a neighbour's head, but
must not be taken as the neighbour's hair.
"""

from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel
from scipy.spatial import cKDTree

from neuralocks_core.anatomy.humanoid import named_head
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import transformed

from ...border.placement import Placement
from ...border.units import Border
from ...border.values import as_names, as_numbers
from ...skel.binding import geom_bind, rest_value
from ...skel.source import find_skeletons
from ...skel.stage_rig import StageRig
from ...skel.surface import drawn, find_skins
from ..carriers.attach import ALIKE, Attachment, on_head
from ..carriers.seat import NEAR, either_ends, kinship, off_skin


@dataclass(frozen=True)
class Unusable:
    """What could be read of a skeleton that cannot be used.

    Attributes:
        prim: the Skeleton.
        headless: whether no joint is named like a head: it may be a hat's, or a face's, on a head that another skeleton moves.
        skins: per mesh, its points at rest in the stage, in its place, where its skeleton stands, and as bound [m].
    """

    prim: Usd.Prim = field(repr=False)
    headless: bool
    skins: list[cKDTree] = field(repr=False)

    @property
    def path(self) -> str:
        """The prim's path."""
        return str(self.prim.GetPath())


def find_unusable(stage: Usd.Stage, usable: set[str]) -> list[Unusable]:
    """The skeletons of a stage other than the `usable` ones, which are given by path."""
    prims = [prim for prim in find_skeletons(stage) if str(prim.GetPath()) not in usable]
    skins, border = find_skins(stage) if prims else {}, Border.of(stage)
    return [Unusable(prim, _headless(prim), _skins(prim, skins, border)) for prim in prims]


def lies_on(
    prim: Usd.Prim,
    found: Attachment | None,
    rigs: list[StageRig],
    unusable: list[Unusable],
    placement: Placement,
) -> Unusable | None:
    """The unusable skeleton on whose character curves without a binding lie, if they do not lie on a usable one's.

    Skin decides; without skin, or with both equally near, the prims that the curves are among.

    Args:
        prim: the curves.
        found: what else would carry them; None if nothing does, or several are equally likely.
        rigs: the skeletons that can be used.
        unusable: those that cannot.
        placement: where the curves stand.
    """
    if found is None or found.far or on_head(prim, found):
        # A hat or a face without a head joint takes no hair from the head below it.
        unusable = [each for each in unusable if not each.headless]
    if not unusable:
        return None
    carriers, border = [found.rig] if found else rigs, rigs[0].border
    known = max(kinship(prim, rig.joints.prim) for rig in carriers)
    unusable = sorted(unusable, key=lambda each: -kinship(prim, each.prim))
    if not placement.usable:  # a scale of zero that hides a character, say, hides its hair, too
        return next((each for each in unusable if kinship(prim, each.prim) > known), None)
    sides = either_ends(prim)
    seated = np.inf
    if found and found.rig.skins:
        seated = min(off_skin(roots, found.rig, found.to_bind) for roots in sides)
    placed = [transformed(roots, border.to_core @ placement.reference) for roots in sides]
    for each in unusable:
        away, kin = min(_off(roots, each.skins) for roots in placed), kinship(prim, each.prim) > known
        if seated <= NEAR:  # on a skin that can be used, too
            its = away + ALIKE < seated or kin and away <= seated + ALIKE
        else:
            its = kin or away <= NEAR
        if its:
            return each
    return None


def _off(roots: np.ndarray, skins: list[cKDTree]) -> float:
    """Distance of roots (n, 3) from the nearest of some skins, in the median [m]; infinite if none is near."""
    far = [float(np.median(tree.query(roots, distance_upper_bound=2 * NEAR)[0])) for tree in skins]
    return min(far, default=np.inf)


def _headless(prim: Usd.Prim) -> bool:
    joints = UsdSkel.Skeleton(prim).GetJointsAttr()
    try:
        # Where the joints are is not read: that may be just what is wrong.
        return named_head(as_names(joints, joints.Get())) is None
    except NeuralocksError:  # of another type than names
        return True


def _skins(prim: Usd.Prim, skins, border: Border) -> list[cKDTree]:
    found = []
    for mesh in skins.get(str(prim.GetPath()), ()):
        with suppress(NeuralocksError):  # what is wrong with it does not matter here
            attribute = UsdGeom.Mesh(mesh).GetPointsAttr()
            points = as_numbers(attribute, "point3f[]", rest_value(attribute))
            points = points[np.isfinite(points).all(axis=1)]
            if not len(points) or not drawn(mesh):
                continue
            bound = transformed(points, geom_bind(mesh))
            found.append(cKDTree(transformed(points, border.to_core @ Placement(mesh).reference)))
            found.append(cKDTree(transformed(bound, border.to_core @ Placement(prim).reference)))
            found.append(cKDTree(transformed(bound, border.to_core)))
    return found
