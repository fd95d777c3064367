# SPDX-License-Identifier: Apache-2.0
"""Errors about a stage that lacks what a bake needs, with the likely cause: what it has instead."""

from contextlib import suppress
from pathlib import Path

from pxr import Usd, UsdGeom, UsdSkel

from neuralocks_core.anatomy.humanoid import named_head
from neuralocks_core.anatomy.joint_names import own_names
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig.hair_names import says_hair, says_hair_alone

from ...border.values import as_names
from ...skel.source import find_skeletons
from ..strands.curves import find_curves
from .stage_notes import uncomposed

MOST_VARIANTS = 64
"""Variants that are tried: each composes the stage anew."""


def no_groom(
    stage: Usd.Stage, path: Path, otherwise: str = "add one, or import a hair file with 'neuralocks import'"
) -> NeuralocksError:
    """The error for a stage without BasisCurves; `otherwise` is the remedy if nothing in it is likely to be hair."""
    other = next((prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Curves)), None)
    if other:
        remedy = f"convert the {other.GetTypeName()} {other.GetPath()}, if they are hair, to BasisCurves"
    else:
        remedy = _on_joints(stage) or otherwise
    there = _in_a_variant(stage) or _switched_off(stage, UsdGeom.BasisCurves)
    return nothing_found(stage, path, "groom (no BasisCurves prim)", remedy, there)


def no_skeleton(stage: Usd.Stage, path: Path) -> NeuralocksError:
    """The error for a stage without a Skeleton: hair alone, or a character exported without its armature."""
    remedy = "export the character with its armature"
    if find_curves(stage):
        remedy = (
            "if it holds hair alone, sublayer or reference it in the shot of its character, on the head; else " + remedy
        )
    return nothing_found(stage, path, "UsdSkel skeleton", remedy, _switched_off(stage, UsdSkel.Skeleton))


def nothing_found(stage: Usd.Stage, path: Path, what: str, remedy: str, there: str = "") -> NeuralocksError:
    """The error for a stage that lacks what a bake needs. What is `there`, but not in use, is told first; then, as a likelier cause than
    that of the `remedy`, that layers are missing.
    """
    return NeuralocksError(f"{path}: holds no {what}; {there or uncomposed(stage) or remedy}")


def has_hair_joints(prim: Usd.Prim) -> bool:
    """Whether joints of a Skeleton are named like hair."""
    joints = UsdSkel.Skeleton(prim).GetJointsAttr()
    with suppress(NeuralocksError):  # errors in them are reported when the skeleton is read
        names = as_names(joints, joints.Get())
        head = named_head(names)
        own = own_names(names, None if head is None else names.index(head))
        # A tail is hair only below a head.
        below = [head is not None and name.startswith(f"{head}/") for name in names]
        return any(says_hair_alone(name) or says_hair(name) and inside for name, inside in zip(own, below))
    return False


def _on_joints(stage: Usd.Stage) -> str:
    """Which skeleton has joints for hair, and what moves them; '' if none has."""
    hairy = next((prim for prim in find_skeletons(stage) if has_hair_joints(prim)), None)
    if hairy is None:
        return ""
    return f"strands are needed here; the hair that is joints of {hairy.GetPath()} is moved by 'neuralocks rig bake', and measured by 'rig evaluate'"


def _switched_off(stage: Usd.Stage, kind: type) -> str:
    """Which prim of this kind would be there if it were active, or no class, and what to do then; '' if there is none."""
    for prim in (prim for prim in stage.TraverseAll() if prim.IsA(kind)):
        if not prim.IsActive():
            return f"{prim.GetPath()} is inactive: activate it"
        if prim.IsAbstract():
            return f"{prim.GetPath()} is part of a class: let a prim inherit that"
    return ""


def _in_a_variant(stage: Usd.Stage) -> str:
    """Which variant that is not chosen has curves, and what to do then; '' if none of MOST_VARIANTS has."""
    tried = 0
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for path in [prim.GetPath() for prim in stage.Traverse() if prim.HasVariantSets()]:
            for name in stage.GetPrimAtPath(path).GetVariantSets().GetNames():
                variants = stage.GetPrimAtPath(path).GetVariantSet(name)
                for variant in variants.GetVariantNames()[: MOST_VARIANTS - tried]:
                    tried += 1
                    variants.SetVariantSelection(variant)
                    curves = next((prim for prim in stage.Traverse() if prim.IsA(UsdGeom.BasisCurves)), None)
                    if curves:
                        found = f"choose variant '{variant}' of '{name}' on {path}, which has {curves.GetPath()}"
                        variants.ClearVariantSelection()
                        return found
                variants.ClearVariantSelection()
    return ""
