# SPDX-License-Identifier: Apache-2.0
"""Joints of arms, legs and eyes by their usual names."""

from neuralocks_core.anatomy.hierarchy import ancestors, depth
from neuralocks_core.anatomy.limb_chains import PARTS_OF_A_BONE, WHOLE

PARTS = {
    "shoulder": ("clavicle", "collar", "collarbone", "clav", "shoulder", "scapula"),
    "upper_arm": ("upperarm", "uparm", "arm", "shldr", "humerus", "armupper", "armup", "uarm"),
    "lower_arm": ("lowerarm", "forearm", "lowarm", "elbow", "armlower", "loarm", "armlow", "farm"),
    "hand": ("hand", "wrist"),
    "upper_leg": ("upperleg", "upleg", "thigh", "legupper", "legup", "legthigh", "hip", "femur"),
    "lower_leg": ("lowerleg", "calf", "shin", "knee", "leglower", "loleg", "leglow", "legknee", "leg"),
    "foot": ("foot", "ankle", "legankle"),
    "eye": ("eye", "eyeball"),
}
_COLLARS = tuple(word for word in PARTS["shoulder"] if word != "shoulder")
_COLLAR_ENDS = ("collarbone", "clavicle")
"""These mean a collar bone even after other words: CAT has an `ArmCollarbone`."""


def named_limbs(side: str, sides, keys, parents) -> dict[str, int]:
    """One side's joints by `PARTS`: of several with the same name (upperarm01, upperarm02) the one nearest the root.

    Args:
        side: 'left' or 'right'.
        sides, keys: of each joint (J), as `joint_names.sides_and_keys` gives them.
        parents: (J,) parent indices, -1 for roots.
    """
    own = _Side(side, sides, keys, parents)
    found = {part: own.first(options) for part, options in PARTS.items()}
    found["hand"], found["foot"] = own.end("hand", found["hand"]), own.end("foot", found["foot"])
    found["upper_leg"], found["lower_leg"] = own.leg(found["upper_leg"], found["lower_leg"])
    found["shoulder"], found["upper_arm"] = own.arm(found["shoulder"], found["upper_arm"], found["lower_arm"])
    return {part: joint for part, joint in found.items() if joint is not None}


class _Side:
    """What names and hierarchy tell of one side's limbs; a joint that is not there is None."""

    def __init__(self, side: str, sides, keys, parents):
        self.own = {joint for joint, each in enumerate(sides) if each == side}
        self.keys, self.parents = keys, parents

    def first(self, options, fits=str.__eq__, over: int | None = None) -> int | None:
        """The joint nearest the root with the first of these names that a joint has, of those over a joint if one is given."""
        among = self.own if over is None else self.own.intersection(ancestors(over, self.parents)[1:])
        for option in options:
            # `LHipJoint` over `LeftHip` is only a socket at the pelvis: of several hips, the lowest is the thigh.
            sign = -1 if option == "hip" else 1
            if hits := [joint for joint in among if fits(self.keys[joint], option)]:
                return min(hits, key=lambda joint: (sign * depth(joint, self.parents), joint))
        return None

    def end(self, part: str, joint: int | None) -> int | None:
        """SMPL and Kinect call toes `foot`, below `ankle`, and fingers `hand`, below `wrist`."""
        way = [] if joint is None else ancestors(joint, self.parents)[::-1]
        return next((each for each in way if each in self.own and self.keys[each] in PARTS[part]), None)

    def leg(self, upper: int | None, lower: int | None) -> tuple[int | None, int | None]:
        """A leg's upper and lower joint."""
        if lower is not None:  # a leg's control may share its name, nearer to the root
            over = self.first(PARTS["upper_leg"], over=lower)
            upper = upper if over is None else over
            above = int(self.parents[lower])
            if upper is None and above in self.own and self.keys[above] == "leg":
                upper = above  # MikuMikuDance in English: `leg`, `knee`, `ankle`
        if upper is None and lower is not None and self._numbered(lower):
            upper, lower = lower, None
        return upper, lower

    def arm(self, shoulder: int | None, upper: int | None, lower: int | None) -> tuple[int | None, int | None]:
        """An arm's shoulder and upper joint."""
        collar, plain = self.first(_COLLARS), self.first(("shoulder",))
        if collar is None:
            collar = self.first(_COLLAR_ENDS, str.endswith)
        if shoulder is None:
            shoulder = collar
        if upper is None and plain is not None:
            # `Shoulder` is the collar bone in one naming and the upper arm in another: it is the arm if no
            # arm is named, unless another bone lies between it and the elbow.
            between = None if collar is not None else self._between(plain, lower)
            upper, shoulder = (plain, collar) if between is None else (between, plain)
        if upper is None and lower is not None and self.parents[lower] >= 0:
            upper = int(self.parents[lower])
        return None if shoulder == upper else shoulder, upper

    def _between(self, shoulder: int, elbow: int | None) -> int | None:
        """The first joint on the way from a shoulder to an elbow that is not part of the shoulder's own bone, if any."""
        way = [] if elbow is None else ancestors(elbow, self.parents)
        if shoulder not in way:
            return None
        own = ("shoulder", *PARTS_OF_A_BONE)
        bones = way[1 : way.index(shoulder)][::-1]
        return next((joint for joint in bones if not any(word in self.keys[joint] for word in own)), None)

    def _numbered(self, joint: int) -> bool:
        """Whether a joint is the first of a limb whose joints all have the limb's name: `leg_01` over `leg_02`."""
        alike = [other for other in self.own - {joint} if self.keys[other] == self.keys[joint]]
        return self.keys[joint] in WHOLE and any(joint in ancestors(other, self.parents) for other in alike)
