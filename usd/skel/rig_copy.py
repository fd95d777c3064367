# SPDX-License-Identifier: Apache-2.0
"""A SkelAnimation that `rig bake` wrote: a copy of the character's own with other rotations of the hair joints."""

import numpy as np
from pxr import Sdf, Usd, UsdSkel, Vt

from ..border.values import as_names

SOURCE = "neuralocks:animation"
"""A relationship to the animation that was copied."""
HAIR = "neuralocks:joints"
"""The joints whose rotations are not from that animation."""
OUTDATED = "neuralocks:outdated"
"""Those of them whose rotations were made when it was another."""


def tell_source(copy: Sdf.PrimSpec, source: Usd.Prim, hair: list[str], outdated: list[str]) -> None:
    """Write on a copy what it was made from, its hair joints, and which of these are of an earlier state of that; nothing if it was
    made from itself.
    """
    if copy.path != source.GetPath():
        Sdf.RelationshipSpec(copy, SOURCE, custom=True).targetPathList.explicitItems = [source.GetPath()]
        for name, joints in ((HAIR, hair), (OUTDATED, outdated)):
            spec = Sdf.AttributeSpec(copy, name, Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
            spec.default, spec.custom = Vt.TokenArray(joints), True


def source_of(animation: Usd.Prim) -> Usd.Prim | None:
    """The animation that one was copied from, if that is still there; None also if it is not a copy."""
    targets = animation.GetRelationship(SOURCE).GetTargets() if animation.HasRelationship(SOURCE) else []
    found = [animation.GetStage().GetPrimAtPath(path) for path in targets]
    whole = [
        prim
        for prim in found
        if prim and prim != animation and prim.IsActive() and UsdSkel.Animation(prim).GetJointsAttr().Get()
    ]
    return whole[0] if len(whole) == 1 and whole[0].IsA(UsdSkel.Animation) else None


def hair_of(copy: Usd.Prim) -> tuple[str, ...]:
    """The hair joints of a copy, if it records them."""
    return _listed(copy, HAIR)


def outdated_of(copy: Usd.Prim) -> tuple[str, ...]:
    """The hair joints of a copy that were made from an earlier state of its source."""
    return _listed(copy, OUTDATED)


def _listed(copy: Usd.Prim, name: str) -> tuple[str, ...]:
    attribute = copy.GetAttribute(name)
    return as_names(attribute, attribute.Get()) if attribute else ()


def alike(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether local joint transforms (T, J, 4, 4) are the same except for rounding."""
    parts = ((part[..., :3, :3], part[..., :3, 3]) for part in (one, other))
    return all(np.allclose(a, b, rtol=0, atol=1e-4 * max(1e-6, np.abs(a).max())) for a, b in zip(*parts))
