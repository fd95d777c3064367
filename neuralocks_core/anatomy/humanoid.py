# SPDX-License-Identifier: Apache-2.0
"""Which joint is the head, which the shoulders: semantic names found from a rig's own names and hierarchy.

The names are those that VRM and the game engines share. Sides are found by token (`Left`, `L`, `.L`, `l` before a
capital), parts by their usual names (`limb_names`; if no joint has one, by shape, `limb_shapes`; if only a limb's first joint
has one, by hierarchy, `limb_chains`), and the trunk by hierarchy: the upper chest is where the paths from the head and from the
arms meet.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from neuralocks_core.anatomy.joint_names import find_joint, leaf, sides_and_keys
from neuralocks_core.anatomy.limb_chains import below_first
from neuralocks_core.anatomy.limb_names import PARTS, ancestors, depth, named_limbs
from neuralocks_core.anatomy.limb_shapes import limbs_by_shape
from neuralocks_core.errors import NeuralocksError

TRUNK = ("hips", "spine", "chest", "upper_chest", "neck", "head")
LIMBS = {"arm": ("upper_arm", "lower_arm", "hand"), "leg": ("upper_leg", "lower_leg", "foot")}
SEMANTIC = TRUNK + tuple(f"{side}_{part}" for side in ("left", "right") for part in PARTS)
BY_HAND = "given by hand"
SHRUGGED = 0.05
"""By this share of the trunk's length, a chest's joint may be above the shoulders."""
COPIED = 1e-4
"""Joints nearer to each other than this share of the rig's size are in the same place."""
_SPINE = ("spine", "chest", "torso", "waist", "abdomen")
_NOT_HEAD = ("end", "top", "nub", "gear", "fore", "band", "twist", "ctrl", "aim", "site")


class NoHead(NeuralocksError):
    """No joint of a rig is named like a head."""


@dataclass(frozen=True)
class Humanoid(Mapping):
    """Semantic name -> joint index; `reasons` says in words how each one was found."""

    joints: dict[str, int]
    reasons: dict[str, str] = field(default_factory=dict)

    def __getitem__(self, name: str) -> int:
        try:
            return self.joints[name]
        except KeyError:
            raise NeuralocksError(
                f"skeleton: no joint found for '{name}'; name it by hand (--head JOINT, or --joint MEANING=JOINT)"
            ) from None

    def get(self, name: str, default=None):
        """The joint index, or `default` if the rig has no such joint."""
        return self.joints.get(name, default)

    def __contains__(self, name) -> bool:
        return name in self.joints

    def __iter__(self):
        return iter(self.joints)

    def __len__(self) -> int:
        return len(self.joints)

    def nearest(self, name: str) -> int:
        """The joint for `name`; if the rig lacks it, the next one towards the trunk, so that every rig can drive a model."""
        side = name.split("_")[0] if name.split("_")[0] in ("left", "right") else ""
        ways = {
            "neck": ["neck", "head"],
            "upper_chest": ["upper_chest", "chest", "spine", "hips", "neck", "head"],
        }
        if side:
            part = name[len(side) + 1 :]
            arm = ["upper_arm", "shoulder"] if part != "shoulder" else ["shoulder"]
            way = [name] + [f"{side}_{p}" for p in arm] + ways["upper_chest"]
        else:
            way = ways.get(name, [name, "hips", "head"])
        return next(self.joints[step] for step in way if step in self.joints)


def find_humanoid(names, parents, positions=None, by_hand: dict[str, str] | None = None, skinned=None) -> Humanoid:
    """Map semantic names to joints.

    Args:
        names: joint paths (J), separated by `/`.
        parents: (J,) parent indices, -1 for roots.
        positions: bind positions (J, 3), which tell the head from other joints on the neck, limbs that names do not
            identify, and copies of the head.
        by_hand: semantic name -> joint path or its last part; overrides what is found.
        skinned: which joints (J,) move skin, if that is known. A control rig has its head twice: a control, named `head`, from
            which the trunk is found, and a copy in the same place that moves the skin, and is the head.

    Raises:
        NoHead: no joint is named like a head.
        NeuralocksError: a joint given by hand does not exist.
    """
    names, parents = list(names), np.asarray(parents, int)
    joints: dict[str, int] = {}
    reasons: dict[str, str] = {}

    def put(name, joint, reason):
        if joint is not None and name not in joints:
            joints[name], reasons[name] = int(joint), reason

    for name, wanted in (by_hand or {}).items():
        if name not in SEMANTIC:
            raise NeuralocksError(f"--joint {name}=...: there is no such meaning; use one of {', '.join(SEMANTIC)}")
        put(name, find_joint(names, wanted), BY_HAND)

    parts = {word for words in PARTS.values() for word in words}
    sides, keys = zip(*sides_and_keys([leaf(name) for name in names], parts), strict=True)
    for side in ("left", "right"):
        for part, joint in named_limbs(side, sides, keys, parents).items():
            put(f"{side}_{part}", joint, f"by name '{leaf(names[joint])}'")
    named, reason = _find_head(names, sides, keys, parents, positions, skinned)
    put("head", named, reason)
    if "head" not in joints:
        raise NoHead("skeleton: no joint is named like a head; name it with --head JOINT")
    others = copies(joints["head"], parents, positions)
    way = ancestors(named if named in others else joints["head"], parents)
    if positions is not None:
        _find_unnamed_limbs(joints, reasons, put, names, sides, parents, positions, way)
    _follow_limbs(joints, put, names, keys, parents, positions)
    _find_trunk(joints, put, names, keys, parents, positions, way)
    if reasons["head"] != BY_HAND and skinned is not None and not skinned[_below(joints["head"], parents)].any():
        with_skin = [joint for joint in others if skinned[joint]]
        if with_skin:
            control, joints["head"] = leaf(names[joints["head"]]), with_skin[0]
            reasons["head"] = f"moves the skin in the place of the control '{control}'"
    ordered = {name: joints[name] for name in SEMANTIC if name in joints}
    return Humanoid(ordered, {name: reasons[name] for name in ordered})


def named_head(names) -> str | None:
    """Path of the joint that is the head by names and hierarchy alone, among joint paths (J) separated by `/`; None if none is."""
    place = {name: index for index, name in enumerate(names)}
    if not place:
        return None
    try:
        found = find_humanoid(names, [place.get(name.rpartition("/")[0], -1) for name in names])
    except NoHead:
        return None
    return names[found["head"]]


def copies(joint: int, parents, positions) -> list[int]:
    """Other joints in the same bind place (J, 3) that are neither above nor below a joint: control rigs have several of a bone."""
    if positions is None:
        return []
    places = np.asarray(positions, float)
    near = np.linalg.norm(places - places[joint], axis=1) < COPIED * np.ptp(places, axis=0).max()
    near[ancestors(joint, parents)] = near[_below(joint, parents)] = False
    return np.flatnonzero(near).tolist()


def _follow_limbs(joints, put, names, keys, parents, positions) -> None:
    """Find a limb's unnamed joints below its first joint."""
    for side in ("left", "right"):
        for first, *rest in (tuple(f"{side}_{part}" for part in limb) for limb in LIMBS.values()):
            if first not in joints or rest[0] in joints:
                continue
            begin, end = joints[first], joints.get(rest[1])
            taken = {joint for name, joint in joints.items() if name.startswith(side)}
            below = below_first(begin, end, keys, parents, positions, taken)
            for name, joint in zip(rest, below, strict=True):
                put(name, joint, f"below '{leaf(names[begin])}'")


def _find_unnamed_limbs(joints, reasons, put, names, sides, parents, positions, way) -> None:
    """Find arms if no arm was found by name, and likewise legs."""
    lacking = [limb for limb in LIMBS if not any(f"{side}_upper_{limb}" in joints for side in ("left", "right"))]
    if lacking:
        found = limbs_by_shape(way, parents, positions, sides)
        for name, joint in (each for limb in lacking for each in found.get(limb, {}).items()):
            lower = name.replace("upper", "lower")
            if lower != name and joints.get(lower) == joint and reasons[lower] != BY_HAND:
                del joints[lower]  # `Leg` is the lower leg only below another leg joint
            put(name, joint, f"by its place, '{leaf(names[joint])}'")


def _find_head(names, sides, keys, parents, positions, skinned):
    def score(i):
        key = keys[i]
        # XNALara's `head neck lower` is a neck, its `head neck upper` the head.
        return (key != "head", not key.endswith("head"), "lower" in key, depth(i, parents), i)

    def beside_head(i):
        """Hair chains hang from necks too: the head is in the middle, and farthest along the neck."""
        at = None if positions is None else np.asarray(positions, float)
        along = 0.0 if at is None or parents[neck] < 0 else (at[i] - at[neck]) @ (at[neck] - at[parents[neck]])
        return (bool(sides[i]), any(bad in keys[i] for bad in _NOT_HEAD), -along, i)

    hits = [
        i
        for i in range(len(keys))
        if "head" in keys[i] and not sides[i] and not any(bad in keys[i].replace("head", "") for bad in _NOT_HEAD)
    ]
    if hits:
        best = min(hits, key=score)
        return best, f"by name '{leaf(names[best])}'"
    necks = [i for i in range(len(keys)) if "neck" in keys[i] and not sides[i]]
    if necks:
        neck = max(necks, key=lambda i: depth(i, parents))
        children = [i for i in range(len(keys)) if parents[i] == neck]
        if children:
            return min(children, key=beside_head), f"child of the neck '{leaf(names[neck])}'"
    # Rigify's deform bones number the whole trunk spine, spine.001 ... spine.006, the last of which is the head; an animal's begin
    # with its tail. Exports of these keep bones of other layers with the same numbers, which move no skin themselves.
    spine = [i for i in range(len(keys)) if keys[i] == "spine" and not sides[i]]
    if len(spine) >= 5:
        own = np.ones(len(names), bool) if skinned is None else skinned
        best = max(spine, key=lambda i: (int("0" + re.search(r"\d{0,9}$", names[i])[0]), own[i], depth(i, parents)))
        return best, f"last joint of the spine '{leaf(names[best])}'"
    return None, ""


def _below(joint: int, parents) -> list[int]:
    """A joint and all below it."""
    found = {joint}
    found.update(other for other, parent in enumerate(parents) if parent in found)  # parents come first
    return sorted(found)


def _under_shoulders(spine: list[int], head: int, shoulders: list[int], positions) -> int:
    """The joint of a spine, from the head down, nearest the head of those that are not above the shoulders: where necks are numbered
    like spines, the joints above are the neck.
    """
    if positions is None:
        return spine[0]
    places = np.asarray(positions, float)
    up = places[head] - places[spine[-1]]
    most = places[shoulders].mean(axis=0) @ up + SHRUGGED * up @ up
    return next((joint for joint in spine if places[joint] @ up <= most), spine[0])


def _find_trunk(joints, put, names, keys, parents, positions, head_way) -> None:
    def meet(*others):
        shared = set(head_way)
        for other in others:
            shared &= set(ancestors(other, parents))
        return next((joint for joint in head_way if joint in shared and joint != head_way[0]), None)

    arms = [joints[n] for n in ("left_upper_arm", "right_upper_arm") if n in joints]
    legs = [joints[n] for n in ("left_upper_leg", "right_upper_leg") if n in joints]
    meeting = meet(*arms) if arms else None
    if meeting is not None and ("neck" in keys[meeting] or meeting == joints.get("neck")):
        # Biped parents the collar bones to the neck.
        trunk = [joint for joint in head_way[head_way.index(meeting) + 1 :] if "neck" not in keys[joint]]
        if trunk:
            put("neck", meeting, f"where the ways from head and arms meet, '{leaf(names[meeting])}'")
            put("upper_chest", trunk[0], f"below the neck '{leaf(names[meeting])}'")
    spine = [joint for joint in head_way[1:] if any(word in keys[joint] for word in _SPINE)]
    if arms and spine and (meeting is None or meeting in head_way[head_way.index(spine[-1]) + 1 :]):
        # Arms parented to the root, as in exports of deform bones only, or to another copy of the trunk.
        sides = [
            joints.get(name.replace("upper_arm", "shoulder"), joints[name]) for name in joints if "upper_arm" in name
        ]
        chest = _under_shoulders(spine, head_way[0], sides, positions)
        put("upper_chest", chest, f"between the shoulders, '{leaf(names[chest])}', since the arms hang from elsewhere")
    if arms:
        put("upper_chest", meeting, "where the ways from head and arms meet")
    if legs:
        put("hips", meet(*legs), "where the ways from head and legs meet")
    between = head_way[1:]
    if "upper_chest" in joints and joints["upper_chest"] in between:
        between = between[: between.index(joints["upper_chest"])]
    named = [joint for joint in between if "neck" in keys[joint]]
    # `MCH-ROT-neck` above `neck` is a helper of a control rig, and does not turn with it.
    named = [joint for joint in named if keys[joint] == "neck"] or named
    neck = named[-1] if named else (between[-1] if between and "upper_chest" in joints else None)
    put("neck", neck, f"between head and chest, '{leaf(names[neck])}'" if neck is not None else "")
    if "upper_chest" in joints:
        below = head_way[head_way.index(joints["upper_chest"]) + 1 :] if joints["upper_chest"] in head_way else []
        if "hips" in joints and joints["hips"] in below:
            below = below[: below.index(joints["hips"])]
        if below:
            put("chest", below[0], "below the upper chest")
            put("spine", below[-1], "above the hips")
    else:
        put("upper_chest", head_way[min(2, len(head_way) - 1)], "two joints below the head")
    put("hips", head_way[-1], "root of the trunk")
