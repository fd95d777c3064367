# SPDX-License-Identifier: Apache-2.0
"""Motion capture files written by tests: a person of twenty joints whose turns are known."""

from collections.abc import Mapping, Sequence
from pathlib import Path

BONES = {  # part: parent, offset from it in a T-pose [cm]; to the person's left is +X, to the front +Z
    "hips": (None, (0, 95, 0)),
    "spine": ("hips", (0, 12, 0)),
    "chest": ("spine", (0, 18, 0)),
    "neck": ("chest", (0, 22, 0)),
    "head": ("neck", (0, 9, 1)),
    **{
        f"{side}_{part}": (None if parent is None else parent.format(side=side), (sign * x, y, z))
        for side, sign in (("left", 1), ("right", -1))
        for part, parent, (x, y, z) in (
            ("shoulder", "chest", (3, 16, 0)),
            ("arm", "{side}_shoulder", (14, 0, 0)),
            ("forearm", "{side}_arm", (28, 0, 0)),
            ("hand", "{side}_forearm", (25, 0, 0)),
            ("thigh", "hips", (9, -3, 0)),
            ("shin", "{side}_thigh", (0, -42, 0)),
            ("foot", "{side}_shin", (0, -42, 0)),
        )
    },
}
MIXAMO = {
    "hips": "mixamorig:Hips",
    "spine": "mixamorig:Spine",
    "chest": "mixamorig:Spine2",
    "neck": "mixamorig:Neck",
    "head": "mixamorig:Head",
    "shoulder": "mixamorig:{Side}Shoulder",
    "arm": "mixamorig:{Side}Arm",
    "forearm": "mixamorig:{Side}ForeArm",
    "hand": "mixamorig:{Side}Hand",
    "thigh": "mixamorig:{Side}UpLeg",
    "shin": "mixamorig:{Side}Leg",
    "foot": "mixamorig:{Side}Foot",
}
MOTION_BUILDER = {part: name.removeprefix("mixamorig:") for part, name in MIXAMO.items()} | {"chest": "Spine1"}
POSER = {
    "hips": "hip",
    "spine": "abdomen",
    "chest": "chest",
    "neck": "neck",
    "head": "head",
    "shoulder": "{s}Collar",
    "arm": "{s}Shldr",
    "forearm": "{s}ForeArm",
    "hand": "{s}Hand",
    "thigh": "{s}Thigh",
    "shin": "{s}Shin",
    "foot": "{s}Foot",
}
NAMINGS = {"Mixamo": MIXAMO, "MotionBuilder": MOTION_BUILDER, "Poser": POSER}


def write_bvh(
    path: Path,
    frames: Sequence[Mapping[str, tuple[float, float, float]]],
    naming: str = "Mixamo",
    places: Sequence[tuple[float, float, float]] | None = None,
) -> Path:
    """A file of the person.

    Args:
        path: to write.
        frames: of each frame, turns about Z, X and Y [degrees], in this order, of parts that turn.
        naming: one of NAMINGS.
        places: of the hips in each frame [cm]; where they are at rest if left out.
    """
    order: list[str] = []

    def block(part: str, indent: str) -> list[str]:
        order.append(part)
        side, _, limb = part.rpartition("_")
        name = NAMINGS[naming][limb].format(Side=side.title(), s=side[:1])
        root = BONES[part][0] is None
        below = [child for child, (parent, _) in BONES.items() if parent == part]
        lines = [
            f"{'ROOT' if root else 'JOINT'} {name}",
            "{",
            "  OFFSET {} {} {}".format(*BONES[part][1]),
            f"  CHANNELS {'6 Xposition Yposition Zposition' if root else '3'} Zrotation Xrotation Yrotation",
            *(line for child in below for line in block(child, "  ")),
            *([] if below else ["  End Site", "  {", "    OFFSET 0 0 8", "  }"]),
            "}",
        ]
        return [indent + line for line in lines]

    text = ["HIERARCHY", *block("hips", ""), "MOTION", f"Frames: {len(frames)}", "Frame Time: 0.033333"]
    for frame, place in zip(frames, places or [BONES["hips"][1]] * len(frames), strict=True):
        text.append(
            " ".join(str(number) for part in (place, *(frame.get(p, (0, 0, 0)) for p in order)) for number in part)
        )
    path.write_text("\n".join(text) + "\n")
    return path
