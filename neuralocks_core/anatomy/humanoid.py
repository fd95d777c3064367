# SPDX-License-Identifier: Apache-2.0
"""Which joint is the head, which the shoulders: semantic names found from a rig's own names and hierarchy.

The names are those that VRM and the game engines share. Sides are found by token (`Left`, `L`, `.L`, `l` before a
capital), parts by their usual names (`limb_names`; if no joint has one, by shape, `limb_shapes`; if only a limb's first joint
has one, by hierarchy, `limb_chains`), and the trunk by hierarchy: the upper chest is where the paths from the head and from the
arms meet.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from neuralocks_core.anatomy.head_by_names import head_by_names
from neuralocks_core.anatomy.hierarchy import ancestors, below, copies
from neuralocks_core.anatomy.joint_names import find_joint, leaf, sides_and_keys
from neuralocks_core.anatomy.limb_chains import below_first
from neuralocks_core.anatomy.limb_names import PARTS, named_limbs
from neuralocks_core.anatomy.limb_shapes import limbs_by_shape
from neuralocks_core.errors import NeuralocksError

TRUNK = ("hips", "spine", "chest", "upper_chest", "neck", "head")
LIMBS = {"arm": ("upper_arm", "lower_arm", "hand"), "leg": ("upper_leg", "lower_leg", "foot")}
SEMANTIC = TRUNK + tuple(f"{side}_{part}" for side in ("left", "right") for part in PARTS)
BY_HAND = "given by hand"
SHRUGGED = 0.05
"""By this share of the trunk's length, a chest's joint may be above the shoulders."""
_SPINE = ("spine", "chest", "torso", "waist", "abdomen")


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
    search = _Search(names, parents, positions, by_hand or {}, skinned)
    search.find_named_limbs()
    search.find_head()
    search.find_unnamed_limbs()
    search.follow_limbs()
    search.find_trunk()
    search.find_head_with_skin()
    ordered = {name: search.joints[name] for name in SEMANTIC if name in search.joints}
    return Humanoid(ordered, {name: search.reasons[name] for name in ordered})


def named_head(names) -> str | None:
    """Path of the joint that is the head by names and hierarchy alone, among joint paths (J) separated by `/`; None if none is."""
    # One without a name would be above all roots, and above itself.
    place = {name: index for index, name in enumerate(names) if name}
    if not place:
        return None
    try:
        found = find_humanoid(names, [place.get(name.rpartition("/")[0], -1) for name in names])
    except NoHead:
        return None
    return names[found["head"]]


class _Search:
    """What is found so far, step by step; what an earlier step found stays.

    Attributes:
        names, parents, positions, skinned: the arguments of `find_humanoid`.
        sides, keys: of each joint (J), as `sides_and_keys` gives them.
        joints, reasons: of the `Humanoid`.
        others: copies of the head.
        way: the head, or the one of its copies that is named so, and its ancestors up to the root.
    """

    def __init__(self, names, parents, positions, by_hand: dict[str, str], skinned):
        self.names, self.parents, self.skinned = list(names), np.asarray(parents, int), skinned
        self.positions = None if positions is None else np.asarray(positions, float)
        self.joints: dict[str, int] = {}
        self.reasons: dict[str, str] = {}
        for name, wanted in by_hand.items():
            if name not in SEMANTIC:
                raise NeuralocksError(f"--joint {name}=...: there is no such meaning; use one of {', '.join(SEMANTIC)}")
            self.put(name, find_joint(self.names, wanted), BY_HAND)
        parts = {word for words in PARTS.values() for word in words}
        self.sides, self.keys = zip(*sides_and_keys([leaf(name) for name in self.names], parts), strict=True)

    def put(self, name: str, joint: int | None, reason: str) -> None:
        """Note the joint for a semantic name that has none yet; nothing if `joint` is None."""
        if joint is not None and name not in self.joints:
            self.joints[name], self.reasons[name] = int(joint), reason

    def quoted(self, joint: int) -> str:
        """A joint's own name."""
        return f"'{leaf(self.names[joint])}'"

    def find_named_limbs(self) -> None:
        for side in ("left", "right"):
            for part, joint in named_limbs(side, self.sides, self.keys, self.parents).items():
                self.put(f"{side}_{part}", joint, f"by name {self.quoted(joint)}")

    def find_head(self) -> None:
        """Find the head by names, and the way from it to the root.

        Raises:
            NoHead: there is none.
        """
        rig = self.names, self.sides, self.keys, self.parents, self.positions, self.skinned
        named, reason = head_by_names(*rig) or (None, "")
        self.put("head", named, reason)
        if "head" not in self.joints:
            raise NoHead("skeleton: no joint is named like a head; name it with --head JOINT")
        self.others = copies(self.joints["head"], self.parents, self.positions)
        self.way = ancestors(named if named in self.others else self.joints["head"], self.parents)

    def find_unnamed_limbs(self) -> None:
        """Find arms if no arm was found by name, and likewise legs."""
        lacking = [limb for limb in LIMBS if not self._both(f"upper_{limb}")]
        if self.positions is None or not lacking:
            return
        found = limbs_by_shape(self.way, self.parents, self.positions, self.sides)
        # By shape, hanging arms that end lower than all else are legs.
        known = {joint for limb in LIMBS for joint in self._both(f"upper_{limb}")}
        found = {limb: part for limb, part in found.items() if limb in lacking and known.isdisjoint(part.values())}
        for name, joint in (each for part in found.values() for each in part.items()):
            lower = name.replace("upper", "lower")
            if lower != name and self.joints.get(lower) == joint and self.reasons[lower] != BY_HAND:
                del self.joints[lower]  # `Leg` is the lower leg only below another leg joint
            self.put(name, joint, f"by its place, {self.quoted(joint)}")

    def follow_limbs(self) -> None:
        """Find a limb's unnamed joints below its first joint."""
        for side in ("left", "right"):
            for first, *rest in (tuple(f"{side}_{part}" for part in limb) for limb in LIMBS.values()):
                if first not in self.joints or rest[0] in self.joints:
                    continue
                begin, end = self.joints[first], self.joints.get(rest[1])
                taken = {joint for name, joint in self.joints.items() if name.startswith(side)}
                found = below_first(begin, end, self.keys, self.parents, self.positions, taken)
                for name, joint in zip(rest, found, strict=True):
                    self.put(name, joint, f"below {self.quoted(begin)}")

    def find_trunk(self) -> None:
        """Find the rest on the way from the head to the root."""
        arms, legs = self._both("upper_arm"), self._both("upper_leg")
        if arms:
            meeting = self._meeting(arms)
            self._find_neck_with_arms(meeting)
            self._find_chest_without_arms(meeting)
            self.put("upper_chest", meeting, "where the ways from head and arms meet")
        if legs:
            self.put("hips", self._meeting(legs), "where the ways from head and legs meet")
        self._find_neck()
        self._find_spine()
        self.put("hips", self.way[-1], "root of the trunk")

    def find_head_with_skin(self) -> None:
        """Take the copy of a control that moves the skin for the head."""
        head = self.joints["head"]
        if self.reasons["head"] == BY_HAND or self.skinned is None or self.skinned[below(head, self.parents)].any():
            return
        with_skin = [joint for joint in self.others if self.skinned[joint]]
        if with_skin:
            self.joints["head"] = with_skin[0]
            self.reasons["head"] = f"moves the skin in the place of the control {self.quoted(head)}"

    def _find_neck_with_arms(self, meeting: int | None) -> None:
        """Biped parents the collar bones to the neck."""
        if meeting is None or not ("neck" in self.keys[meeting] or meeting == self.joints.get("neck")):
            return
        trunk = [joint for joint in self._under(meeting) if "neck" not in self.keys[joint]]
        if trunk:
            neck = self.quoted(meeting)
            self.put("neck", meeting, f"where the ways from head and arms meet, {neck}")
            self.put("upper_chest", trunk[0], f"below the neck {neck}")

    def _find_chest_without_arms(self, meeting: int | None) -> None:
        """Arms may be parented to the root, as in exports of deform bones only, or to another copy of the trunk."""
        spine = [joint for joint in self.way[1:] if any(word in self.keys[joint] for word in _SPINE)]
        if spine and (meeting is None or meeting in self._under(spine[-1])):
            chest = self._under_shoulders(spine)
            place = f"between the shoulders, {self.quoted(chest)}"
            self.put("upper_chest", chest, f"{place}, since the arms hang from elsewhere")

    def _under_shoulders(self, spine: list[int]) -> int:
        """The joint of a spine, from the head down, nearest the head of those that are not above the shoulders: where necks are
        numbered like spines, the joints above are the neck.
        """
        if self.positions is None:
            return spine[0]
        arms = {name: joint for name, joint in self.joints.items() if "upper_arm" in name}
        shoulders = [self.joints.get(name.replace("upper_arm", "shoulder"), arm) for name, arm in arms.items()]
        up = self.positions[self.way[0]] - self.positions[spine[-1]]
        most = self.positions[shoulders].mean(axis=0) @ up + SHRUGGED * up @ up
        return next((joint for joint in spine if self.positions[joint] @ up <= most), spine[0])

    def _find_neck(self) -> None:
        between = _before(self.joints.get("upper_chest"), self.way[1:])
        named = [joint for joint in between if "neck" in self.keys[joint]]
        # `MCH-ROT-neck` above `neck` is a helper of a control rig, and does not turn with it.
        necks = [joint for joint in named if self.keys[joint] == "neck"] or named
        if not necks and "upper_chest" in self.joints:
            necks = between
        if necks:
            self.put("neck", necks[-1], f"between head and chest, {self.quoted(necks[-1])}")

    def _find_spine(self) -> None:
        if "upper_chest" not in self.joints:
            self.put("upper_chest", self.way[min(2, len(self.way) - 1)], "two joints below the head")
            return
        between = _before(self.joints.get("hips"), self._under(self.joints["upper_chest"]))
        if between:
            self.put("chest", between[0], "below the upper chest")
            self.put("spine", between[-1], "above the hips")

    def _both(self, part: str) -> list[int]:
        """Joints of this part of a limb that were found, the left one first."""
        return [self.joints[name] for name in (f"left_{part}", f"right_{part}") if name in self.joints]

    def _meeting(self, limbs: list[int]) -> int | None:
        """Where the ways from the head and from these joints to the root meet, if they do below the head."""
        ways = [ancestors(joint, self.parents) for joint in limbs]
        return next((joint for joint in self.way[1:] if all(joint in way for way in ways)), None)

    def _under(self, joint: int) -> list[int]:
        """The way from a joint to the root, without it; empty if the way from the head passes it by."""
        return self.way[self.way.index(joint) + 1 :] if joint in self.way else []


def _before(end: int | None, way: list[int]) -> list[int]:
    """The joints of a way before one of them; all if it is not on the way."""
    return way[: way.index(end)] if end in way else way
