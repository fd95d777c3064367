# SPDX-License-Identifier: Apache-2.0
"""Joints of arms, legs and eyes by their usual names."""

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

    every = range(len(keys))

    def nearest(option, fits, among):
        hits = [i for i in among if sides[i] == side and fits(keys[i], option)]
        # `LHipJoint` over `LeftHip` is only a socket at the pelvis: of several hips, the lowest is the thigh.
        sign = -1 if option == "hip" else 1
        return min(hits, key=lambda i: (sign * depth(i, parents), i), default=None)

    def first(options, fits=str.__eq__, among=every):
        hits = (nearest(option, fits, among) for option in options)
        return next((hit for hit in hits if hit is not None), None)

    found = {part: first(options) for part, options in PARTS.items()}
    for end in ("hand", "foot"):  # SMPL and Kinect call toes `foot`, below `ankle`, and fingers `hand`, below `wrist`
        way = [] if found[end] is None else ancestors(found[end], parents)[::-1]
        found[end] = next((i for i in way if sides[i] == side and keys[i] in PARTS[end]), None)
    worded = first(_COLLAR_ENDS, str.endswith)
    collar, plain = first(_COLLARS), first(("shoulder",))
    collar = worded if collar is None else collar
    if found["shoulder"] is None:
        found["shoulder"] = collar
    if found["lower_leg"] is not None:  # a leg's control may share its name, nearer to the root
        over = first(PARTS["upper_leg"], among=ancestors(found["lower_leg"], parents)[1:])
        found["upper_leg"] = found["upper_leg"] if over is None else over
        above = parents[found["lower_leg"]]
        if found["upper_leg"] is None and above >= 0 and sides[above] == side and keys[above] == "leg":
            found["upper_leg"] = int(above)  # MikuMikuDance in English: `leg`, `knee`, `ankle`
    if found["upper_leg"] is None and _numbered(found["lower_leg"], side, sides, keys, parents):
        found["upper_leg"], found["lower_leg"] = found["lower_leg"], None
    if found["upper_arm"] is None and plain is not None:
        # `Shoulder` is the collar bone in one naming and the upper arm in another: it is the arm if no
        # arm is named, unless another bone lies between it and the elbow.
        between = None if collar is not None else _between(plain, found["lower_arm"], keys, parents)
        found["upper_arm"], found["shoulder"] = (plain, collar) if between is None else (between, plain)
    if found["upper_arm"] is None and found["lower_arm"] is not None and parents[found["lower_arm"]] >= 0:
        found["upper_arm"] = int(parents[found["lower_arm"]])
    if found["shoulder"] is not None and found["shoulder"] == found["upper_arm"]:
        found["shoulder"] = None
    return {part: joint for part, joint in found.items() if joint is not None}


def ancestors(joint: int, parents) -> list[int]:
    """A joint and its ancestors, up to the root."""
    way = []
    while joint >= 0:
        way.append(int(joint))
        joint = parents[joint]
    return way


def depth(joint: int, parents) -> int:
    """Number of joints above a joint."""
    return len(ancestors(joint, parents)) - 1


def _between(shoulder: int, elbow: int | None, keys, parents) -> int | None:
    """The first joint on the way from a shoulder to an elbow that is not part of the shoulder's own bone, if any."""
    way = [] if elbow is None else ancestors(elbow, parents)
    if shoulder not in way:
        return None
    own = ("shoulder", *PARTS_OF_A_BONE)
    bones = (joint for joint in way[1 : way.index(shoulder)][::-1] if not any(word in keys[joint] for word in own))
    return next(bones, None)


def _numbered(joint, side, sides, keys, parents) -> bool:
    """Whether a joint is the first of a limb whose joints all have the limb's name: `leg_01` over `leg_02`."""
    return joint is not None and any(
        i != joint and keys[i] == keys[joint] in WHOLE and sides[i] == side and joint in ancestors(i, parents)
        for i in range(len(keys))
    )
