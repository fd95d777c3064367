# SPDX-License-Identifier: Apache-2.0
"""Motion capture files written by tests: a person of twenty joints whose turns are known."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

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
Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Turns the person to stand along Z, looking along -Y, as Blender exports."""
_NEXT = {"hips": "spine", "spine": "chest", "chest": "neck", "arm": "forearm", "forearm": "hand"} | {
    "shoulder": "arm",
    "thigh": "shin",
    "shin": "foot",
    "hand": "hand",
}


def along_x(part: str) -> np.ndarray:
    """Axes (3, 3), columns, of a joint whose bone goes along its X; so all bones do if no joint is turned."""
    side, _, limb = part.rpartition("_")
    end = _NEXT.get(limb)
    bone = np.array(BONES[f"{side}_{end}" if side else end][1] if end else (0, 1, 0), float)
    if limb == "foot":
        bone = np.array([0, 0, 1.0])
    x = np.round(bone / np.abs(bone).max())
    y = np.array([0, 0, 1.0]) if limb != "foot" else np.array([0, 1.0, 0])
    return np.stack([x, y, np.cross(x, y)], axis=1)


def along_x_mirrored(part: str) -> np.ndarray:
    """The same, with bones of the right side along -X, and trunk and hips a quarter turn apart."""
    axes = along_x(part)
    if part == "hips":
        return axes[:, [0, 2, 1]] * [1, 1, -1]
    return axes * [-1, -1, 1] if part.startswith("right") else axes


def write_bvh(
    path: Path,
    frames: Sequence[Mapping[str, tuple[float, float, float]]],
    naming: str = "Mixamo",
    places: Sequence[tuple[float, float, float]] | None = None,
    axes: Callable[[str], np.ndarray] | None = None,
    turn: np.ndarray | None = None,
) -> Path:
    """A file of the person.

    Args:
        path: to write.
        frames: of each frame, turns about Z, X and Y [degrees], in this order, of parts that turn.
        naming: one of NAMINGS.
        places: of the hips in each frame [cm]; their rest place if left out.
        axes: gives each part's joint axes (3, 3), columns, in the T-pose; the world's if left out.
        turn: of the whole take (3, 3).
    """
    if axes or turn is not None:
        axes, turn = axes or (lambda part: np.eye(3)), np.eye(3) if turn is None else turn
        places = [turn @ place for place in places or [BONES["hips"][1]] * len(frames)]
        frames = [_in_axes(frame, axes, turn) for frame in frames]
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
            "  OFFSET {} {} {}".format(
                *(BONES[part][1] if root or not axes else axes(BONES[part][0]).T @ BONES[part][1])
            ),
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


def _in_axes(frame: Mapping, axes: Callable[[str], np.ndarray], turn: np.ndarray) -> dict:
    """A frame's turns [degrees], given in the T-pose's axes, converted for joints that have other axes."""
    world, found = {}, {}
    for part, (parent, _) in BONES.items():
        local = Rotation.from_euler("ZXY", frame.get(part, (0, 0, 0)), degrees=True).as_matrix()
        world[part] = (turn if parent is None else world[parent]) @ local
        here = world[part] @ axes(part)
        above = np.eye(3) if parent is None else world[parent] @ axes(parent)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of two angles of which only the sum is known, one is zero
            found[part] = tuple(Rotation.from_matrix(above.T @ here).as_euler("ZXY", degrees=True))
    return found
