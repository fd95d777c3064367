# SPDX-License-Identifier: Apache-2.0
"""Notes: what a user should know about a shot that can still be baked. One line each: prim or file, fact, remedy."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from pxr import Pcp, Usd, UsdGeom

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.boundary.history import joints_read
from neuralocks_core.boundary.spec import POSE_JOINTS
from neuralocks_core.boundary.stepped import Stepped
from neuralocks_core.character import HEAD_WIDTHS, Character
from neuralocks_core.rig.hair_names import says_hair
from neuralocks_core.rotation import flat

from ...border.damage import text_of
from ...border.stage_files import unsaved
from ...border.units import Border
from ...skel.stage_rig import StageRig

UNIT = UsdGeom.Tokens.metersPerUnit
FEW = 3
"""Up to this many similar lines are told one by one."""


def composition_notes(stage: Usd.Stage, path: Path) -> list[str]:
    """What USD could not compose: missing layers, for example."""
    return [f"{path.name}: {_told(error)}" for error in _composition_errors(stage)]


def uncomposed(stage: Usd.Stage) -> str:
    """What USD could not compose, as the likely cause if a stage lacks something, and the remedy; '' if it could compose all."""
    errors = _composition_errors(stage)
    if missing := _without_file(errors):
        fact = _told(missing[0]).removesuffix("; skipping.")
        return f"parts of it are missing or damaged ({fact}); add or repair the files that it refers to"
    return f"USD could not compose all of it ({_told(errors[0])}); repair that" if errors else ""


def _told(error) -> str:
    return " ".join(text_of(error).split())[:200]


def _without_file(errors: list) -> list:
    """Those of files that cannot be read; others, such as of cycles, may name the stage's first layer."""
    kinds = Pcp.ErrorType_InvalidAssetPath, Pcp.ErrorType_InvalidSublayerPath
    return [error for error in errors if error.errorType in kinds]


def _composition_errors(stage: Usd.Stage) -> list:
    """Empty if USD does not report them, as in Blender 4.2 (USD 24.05)."""
    return stage.GetCompositionErrors() if hasattr(stage, "GetCompositionErrors") else []


def layer_notes(stage: Usd.Stage, path: Path) -> list[str]:
    """Notes if a sublayer has another unit or axis than the shot's first layer, the only one from which USD reads them; and if no
    layer states the unit in effect, or how long a frame is.
    """
    border, layers = Border.of(stage), stage.GetLayerStack(includeSessionLayers=False)
    notes = border.frame_notes(path.name)
    for layer in layers[1:]:
        if differs := border.differing(layer):
            notes.append(
                f"{path.name}: its layer {layer.GetDisplayName()} {differs}: the first layer's count; author them there"
            )
            break
    return notes + unit_notes(stage, path)


def unit_notes(stage: Usd.Stage, path: Path) -> list[str]:
    """The note on a stage of which no layer states the unit in effect."""
    unit, layers = Border.of(stage).metres_per_unit, stage.GetLayerStack(includeSessionLayers=False)
    units = [layer.pseudoRoot.GetInfo(UNIT) for layer in stage.GetUsedLayers() if layer.pseudoRoot.HasInfo(UNIT)]
    if unit in units or any(layer.pseudoRoot.HasInfo(UNIT) for layer in layers):
        return []
    return [f"{path.name}: no metersPerUnit, so a unit counts as a centimetre; author it"]


def asked_notes(stage: Usd.Stage, rigs: Iterable[StageRig], codes: list[float], loop: bool) -> list[str]:
    """The notes on what a bake was asked for.

    Args:
        stage: the shot.
        rigs: skeletons that carry what is baked.
        codes: the time codes, ascending.
        loop: hair moves on outside of the animation, too, as `StageRig.loop_notes` tells.
    """
    return _edited(stage) + [text for rig in rigs if not loop for text in out_of_range(rig, codes[0], codes[-1])]


def _edited(stage: Usd.Stage) -> list[str]:
    """The notes on layers of a shot with unsaved changes, so that another program reads a different shot."""
    names = sorted(layer.GetDisplayName() for layer in unsaved(stage) if layer.realPath)
    return [f"{name}: has unsaved changes, which this bake has in it; save it" for name in names]


def out_of_place(stage: Usd.Stage, out: Path) -> list[str]:
    """The note on a layer over a shot that cannot find, from its own folder, all files that the shot finds from its folder."""
    if os.path.realpath(out.parent) == os.path.dirname(os.path.realpath(stage.GetRootLayer().realPath)):
        return []
    found = {text_of(error) for error in _composition_errors(stage)}
    told = [text_of(error) for error in _without_file(_composition_errors(Usd.Stage.Open(str(out))))]
    lost = [text for text in told if text not in found]
    return [
        f"{out}: {' '.join(text.split())[:200].rstrip('.')}, which the shot finds from its own folder; write the bake there, or "
        "have USD search that folder (PXR_AR_DEFAULT_SEARCH_PATH)"
        for text in lost[:1]
    ]


def left_out(error) -> str:
    """The note on a skeleton that cannot be used, if others can."""
    return f"{error} (this skeleton is left out)"


def first_of(rigs: Sequence[StageRig]) -> list[str]:
    """The note on a file with several skeletons, of which the first is taken."""
    if len(rigs) < 2:
        return []
    return [
        f"{rigs[0].path}: the first of {len(rigs)} skeletons is taken; choose another, such as {rigs[1].path}, with "
        "--skeleton PRIM"
    ]


def few(lines: list[str], others: str = "prims are left out like that") -> list[str]:
    """The first of many similar lines about prims, and how many more there are: a set may have hundreds."""
    return lines if len(lines) <= FEW + 1 else [*lines[:FEW], f"{len(lines) - FEW} more {others}"]


def not_animated(rig: StageRig) -> str:
    """Why a skeleton cannot be baked; if UsdSkel ignores its animation, also what is wrong with the animation."""
    ignored = rig.joints.ignored
    why = f" ({ignored.split(': ', 1)[1].split(';')[0]})" if ignored else ""
    return (
        f"{rig.path}: the skeleton has no animation{why}; bind a SkelAnimation to it (skel:animationSource), or let a wind "
        "blow (--wind X,Y,Z)"
    )


def rig_notes(rig: StageRig, joints=POSE_JOINTS) -> list[str]:
    """The notes on a held pose and on poses that are held for some frames, on joints that were not recognized by name and on a
    head of an unlikely size.
    """
    held = rig.joints.animated and len(rig.time_codes) == 1
    notes = [f"{rig.path}: the animation has one sample, so the body holds one pose"] if held else []
    return notes + on_twos(rig, joints) + unfound(rig, joints) + unlikely_head(rig)


def on_twos(rig: StageRig, joints=POSE_JOINTS) -> list[str]:
    """The note on animation that holds its poses for some frames each, as far as hair reads it."""
    if "head" not in rig.character.humanoid:
        return []
    read = joints_read(rig.character, joints)
    held = np.concatenate([Stepped.of(part, read).held for part in rig.clip.parts])
    if not len(held):
        return []
    frames = np.array([held.min(), held.max()]) * np.median(np.diff(rig.time_codes)) / rig.border.frame
    named = " to ".join(dict.fromkeys(f"{each:.3g}" for each in frames))
    return [
        f"{rig.path}: its animation holds poses for {named} frames each; hair moves as if the motion were smooth in between"
    ]


def unfound(rig: StageRig, joints=POSE_JOINTS) -> list[str]:
    """The notes on joints that a network reads, and on elbows that tell it how arms are bound, that were not recognized."""
    missing = [name for name in joints if name not in rig.character.humanoid]
    if not missing:
        return _without_elbow(rig, joints)
    head = rig.character.humanoid.get("head")
    if head is not None and rig.joints.parents[head] < 0:
        return [
            f"{rig.path}: nothing carries its head joint '{rig.joints.names[head]}', so hair does not feel how neck and body "
            "turn against it; export it with the body's skeleton as one"
        ]
    return [
        f"{rig.path}: no joint found for {', '.join(missing)}; the next one towards the trunk is used, or name it with --joint",
        *_without_elbow(rig, joints),
    ]


def _without_elbow(rig: StageRig, joints) -> list[str]:
    """The note on upper arms that are read as if they were bound straight sideways."""
    humanoid = rig.character.humanoid
    arms = [name for name in joints if name.endswith("_upper_arm") and name in humanoid]
    elbows = [name for name in (arm.replace("upper", "lower") for arm in arms) if name not in humanoid]
    if not elbows:
        return []
    return [
        f"{rig.path}: no joint found for {', '.join(elbows)}, so the arms count as bound in a T-pose; "
        f"name it with --joint {elbows[0]}=JOINT"
    ]


def unlikely_head(rig: StageRig) -> list[str]:
    """The note on a head whose size no human head has."""
    width = rig.character.head_width
    if width is None or HEAD_WIDTHS[0] < width < HEAD_WIDTHS[1]:
        return []
    foreign = rig.border.foreign(rig.joints.prim.GetAttribute("bindTransforms"))
    remedy = foreign or f"; check the stage's metersPerUnit ({rig.border.metres_per_unit:g})"
    return [f"{rig.path}: the head is {width:.3g} m wide{remedy}"]


def another_head(rig: StageRig) -> list[str]:
    """The note on hair joints of a second character in the skeleton, if no bake moves them."""
    names, character, moved = rig.joints.names, rig.character, rig.joints.baked_hair
    for joint in np.flatnonzero(~character.of_head):
        heads = heads_above(character, joint)
        if heads and says_hair(character.own_names[joint]) and names[joint] not in moved:
            return [
                f"{rig.path}: '{leaf(names[joint])}' hangs from '{heads[0]}', not from '{leaf(names[character.head])}', so it is not "
                f"moved; take that head with --head {heads[0]}"
            ]
    return []


def heads_above(character: Character, joint: int) -> list[str]:
    """Names of the joints above one that are named like a head, the nearest first."""
    names, parents, found = character.skeleton.names, character.skeleton.parents, []
    while (joint := int(parents[joint])) >= 0:
        found += [leaf(names[joint])] if "head" in character.own_names[joint].lower() else []
    return found


def without_turn(rig: StageRig, pose_joints=POSE_JOINTS) -> list[str]:
    """What stops a bake: joints that the network reads but that have no rotation, hidden by a scale of zero or mirrored."""
    found: list[str] = []
    if "head" not in rig.character.humanoid:
        return found
    for joint in dict.fromkeys(joints_read(rig.character, pose_joints)):
        linear = rig.clip.joints[:, joint, :3, :3]
        hidden = flat(linear)
        for fact, bad, remedy in (
            ("has zero scale", hidden, "give it a scale above zero; 0.0001 hides what it moves, too"),
            (
                "is mirrored or flat",
                ~hidden & (np.linalg.det(linear) <= 0),
                "apply or remove the negative or zero scale",
            ),
        ):
            if bad.any():
                code = rig.time_codes[bad.argmax()]
                # If a prim above has no rotation either, joints lack theirs because of it.
                placed = rig.joints.placement
                whose = (
                    placed.whose(_turnless, code)
                    if _turnless(placed.at(code))
                    else f"joint '{rig.joints.names[joint]}'"
                )
                found.append(f"{rig.path}: {whose} {fact} at time code {code:g}; {remedy}")
    return found


def _turnless(transform: np.ndarray) -> bool:
    """Whether a transform (4, 4) has an axis of no length, or is mirrored."""
    linear = transform[:3, :3]
    return bool(flat(linear) or np.linalg.det(linear) < 0)


def partial_body(rig: StageRig, left: Sequence[str]) -> list[str]:
    """The note on a character in several skeletons, head and body or clothes: on those of which `whole_body` can use nothing."""
    if not left:
        return []
    return [
        f"{rig.path}: {', '.join(few([*left], 'skeletons'))} {'is' if len(left) == 1 else 'are'} the same character, but no joint there moves like one "
        "of the same name here, so hair is not kept out of those meshes; bind all to one skeleton if hair touches them"
    ]


def out_of_range(rig: StageRig, first: float, last: float) -> list[str]:
    """The note on a range of time codes that the animation mostly does not cover, so that the character stands still."""
    samples = rig.joints.keys.every
    if len(samples) < 2:
        return []
    within = min(samples[-1], last) - max(samples[0], first)
    if within >= 0.5 * (last - first) or _moves_on(rig, first, last):  # a shot may have handles
        return []
    much, held = ("none of it", "a held pose") if within < 0 else ("little of it", "elsewhere a held pose")
    return [
        f"{rig.path}: its animation lies at time codes {samples[0]:g} to {samples[-1]:g}, {much} within {first:g} to "
        f"{last:g}: {held}; check --frames, the shot's range and the layer offsets"
    ]


def _moves_on(rig: StageRig, first: float, last: float) -> bool:
    """Whether what places a character moves before its first key or after its last one: a spline may loop."""
    keys, placed = rig.joints.keys.every, rig.joints.placement
    codes = [code for code in np.linspace(first, last, 9) if not keys[0] <= code <= keys[-1]]
    ends = np.clip(codes, keys[0], keys[-1])
    return not all(np.allclose(placed.at(code), placed.at(end)) for code, end in zip(codes, ends))


def without_strength(strength: float, dynamic: bool) -> list[str]:
    """The note on a motion strength that a model of held poses does not feel."""
    if strength == 1 or dynamic:
        return []
    return ["motion strength: has no effect on a model of held poses; leave it at 1, or give a dynamic model"]
