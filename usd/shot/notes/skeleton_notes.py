# SPDX-License-Identifier: Apache-2.0
"""Notes on skeletons: which is taken, which joints are found in it, how they move, and what its body lacks."""

from collections.abc import Sequence

import numpy as np

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.boundary.history import joints_read
from neuralocks_core.boundary.spec import POSE_JOINTS
from neuralocks_core.boundary.stepped import Stepped
from neuralocks_core.character import HEAD_WIDTHS, Character
from neuralocks_core.rig.hair_names import says_hair
from neuralocks_core.rotation import flat

from ...border.told_once import few
from ...skel.stage_rig import StageRig


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
