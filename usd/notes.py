# SPDX-License-Identifier: Apache-2.0
"""What a user should know about a shot though it stops no bake, one line each: prim or file, fact, and what to check."""

from pathlib import Path

import numpy as np
from pxr import Usd

from neuralocks_core.boundary import POSE_JOINTS
from neuralocks_core.character import HEAD_WIDTHS
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import Groom

from .attach import Attachment, rig_joint
from .rig_source import StageRig


def composition_notes(stage: Usd.Stage, path: Path) -> list[str]:
    """What USD could not compose, missing layers say."""
    return [f"{path.name}: {' '.join(str(error).split())[:200]}" for error in stage.GetCompositionErrors()]


def nothing_found(stage: Usd.Stage, path: Path, what: str, remedy: str) -> NeuralocksError:
    """The error for a stage without something that a bake needs: where layers are missing, it was in one of those."""
    missing = composition_notes(stage, path)
    if missing:
        loaded = missing[0].removeprefix(f"{path.name}: ").removesuffix("; skipping.")
        remedy = f"not all of it is there ({loaded}); bring along what the file refers to"
    return NeuralocksError(f"{path}: holds no {what}; {remedy}")


def left_out(error) -> str:
    """What is wrong with a skeleton that is not needed."""
    return f"{error} (this skeleton is left out)"


def few(lines: list[str], most: int = 3) -> list[str]:
    """The first of many similar lines about prims, and how many more there are: a set may have hundreds."""
    return (
        lines if len(lines) <= most + 1 else [*lines[:most], f"{len(lines) - most} more prims are left out like that"]
    )


def no_points(path: str) -> str:
    """Of an empty prim of curves beside others."""
    return f"{path}: the curves have no points; left out"


def not_animated(rig: StageRig) -> str:
    """Why a skeleton cannot be baked; where it has an animation that UsdSkel ignores, what is wrong with that."""
    animation = rig.source.animation
    said = [] if animation is None else [note for note in rig.notes if note.startswith(f"{animation.GetPath()}: ")]
    why = f" ({said[0].split(': ', 1)[1].split(';')[0]})" if said else ""
    return f"{rig.path}: the skeleton has no animation{why}; bind a SkelAnimation to it (skel:animationSource)"


def stands_still(path: str, rig: StageRig) -> str:
    """Of a groom whose character is not animated, beside others."""
    return f"{path}: {rig.path}, which carries it, has no animation; left out"


def another_carries(path: str, rig: StageRig) -> str:
    """Of a groom of another skeleton than the one that was named."""
    return f"{path}: is carried by {rig.path}; left out, or name it with --groom"


def too_far(prim: Usd.Prim, found: Attachment) -> str:
    """Why the curves of a prim are not taken for hair."""
    return (
        f"{prim.GetPath()}: lies {found.far:.3g} m from joint '{rig_joint(found).split('/')[-1]}' of {found.rig.path} "
        f"and on no skin{found.rig.border.foreign(prim.GetAttribute('points'))}, so it is not taken for hair; "
        "if it is, name it with --groom"
    )


def rig_notes(rig: StageRig) -> list[str]:
    """Held poses, joints that no name told, heads of an unlikely size."""
    notes = []
    if len(rig.time_codes) == 1:
        notes.append(f"{rig.path}: the animation has one sample, so the hair is that of a held pose")
    missing = [name for name in POSE_JOINTS if name not in rig.character.humanoid]
    if missing:
        notes.append(
            f"{rig.path}: no joint found for {', '.join(missing)}; "
            "the next one towards the trunk serves, or name it with --joint"
        )
    width = rig.character.head_width
    if width is not None and not HEAD_WIDTHS[0] < width < HEAD_WIDTHS[1]:
        notes.append(
            f"{rig.path}: the head is {width:.3g} m wide; "
            f"check the stage's metersPerUnit ({rig.border.metres_per_unit:g})"
        )
    return notes


def out_of_range(rig: StageRig, first: float, last: float) -> list[str]:
    """What to say of frames (time codes) in which the character stands still, since its animation is elsewhere."""
    samples = rig.source.samples
    if len(samples) < 2 or (samples[0] <= last and first <= samples[-1]):
        return []
    return [
        f"{rig.path}: its animation lies at time codes {samples[0]:g} to {samples[-1]:g}, none of it within {first:g} to "
        f"{last:g}: a held pose; check --frames, the shot's range and the layer offsets"
    ]


def groom_notes(path: str, groom: Groom) -> list[str]:
    """Strands of no length, and lengths that no hair has; `path` is the groom's prim."""
    notes = []
    filled = np.flatnonzero(groom.counts > 0)
    spread = np.zeros(groom.strand_count, np.float32)
    low = np.minimum.reduceat(groom.points, groom.starts[filled])
    high = np.maximum.reduceat(groom.points, groom.starts[filled])
    spread[filled] = (high - low).max(axis=1)
    still = int((spread <= 1e-7).sum())
    if still:
        notes.append(
            f"{path}: {still} of {groom.strand_count} strands have no two distinct points; they follow the head rigidly"
        )
    longest = float(spread.max())
    if longest > 2.5 or longest < 0.002:
        notes.append(f"{path}: the longest strand reaches {longest:.3g} m; check the stage's metersPerUnit")
    return notes
