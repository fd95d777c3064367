# SPDX-License-Identifier: Apache-2.0
"""Motion capture in BVH files: skeleton and clip in metres."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from neuralocks_core.anatomy.humanoid import Humanoid, NoHead, find_humanoid
from neuralocks_core.anatomy.standing import FEET
from neuralocks_core.anatomy.upright import AXES, standing_axis, upright
from neuralocks_core.character import Skeleton
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.formats.bvh_words import LARGEST, Words
from neuralocks_core.motion import LARGEST_CLIP, Clip
from neuralocks_core.rotation import angle_between

MOST_JOINTS = 2048
LONGEST_STEP = 0.2
"""[s] Frame times longer than this are not motion; the number may be a frame rate."""
LONGEST_NAME = 200
"""At most this many characters of a joint's name are kept."""
MOST_NAMES = 2**24
"""Characters of all joint paths together; each path repeats those of the joints above."""
UNITS = (1.0, 0.01, 0.0254, 0.056444, 0.001)
"""[m] Units of length that files use; the fourth is the CMU library's (an inch over 0.45)."""


@dataclass(frozen=True)
class Motion:
    """The content of a BVH file.

    Attributes:
        name: the file's stem.
        skeleton: joints; the bind pose has all rotations zero and is turned so that it stands along Y, with its root at the
            file's offset; if that pose stands along no axis, it is a T-pose found in the motion.
        clip: world transforms of these joints, Y up.
        unit: metres per unit of the file, as used.
        up: 'Y' or 'Z', the file's axis that was taken as up.
        guessed: whether the bind pose was found in the motion.
    """

    name: str
    skeleton: Skeleton
    clip: Clip
    unit: float
    up: str = "Y"
    guessed: bool = False


def read_bvh(path: str | Path) -> Motion:
    """Read a BVH file.

    Args:
        path: the file. It does not state its unit, so the usual unit that gives the skeleton a human height is used, or else
            the one that makes it 1.7 m tall.

    Raises:
        NeuralocksError: the file cannot be read, is truncated or malformed, or its values are impossible.
    """
    path = Path(path)
    words = Words(path)
    joints = _hierarchy(words)
    frames, step = _motion_header(words, joints)
    values = _values(words, frames, sum(len(joint.channels) for joint in joints))
    paths, parents, rest = _paths(joints), [joint.parent for joint in joints], _rest(joints)
    try:
        humanoid = find_humanoid(paths, parents, rest)
    except NoHead:
        humanoid = None
    unit = _likely_unit(joints, rest, humanoid)
    world = _forward(joints, values, unit)
    world = world[_first_of_motion(world) :]
    bind = np.tile(np.eye(4), (len(joints), 1, 1))
    bind[:, :3, 3] = rest * unit
    up, guessed = "Y", False
    if humanoid is not None:
        found = upright(bind, world, parents, humanoid)
        bind, world, up, guessed = found.rest, found.world, found.up, found.guessed
    clip = Clip(np.arange(len(world)) * step, world)
    return Motion(path.stem, Skeleton(paths, parents, bind), clip, unit, up, guessed)


@dataclass
class _Joint:
    name: str
    parent: int
    path_length: int
    offset: np.ndarray
    channels: tuple[str, ...] = ()
    end: np.ndarray | None = None


def _hierarchy(words: Words) -> list[_Joint]:
    words.expect("HIERARCHY")
    joints: list[_Joint] = []
    within = -1
    while True:
        word = words.next()
        key, joint = word.upper(), joints[within] if within >= 0 else None
        if key == ("JOINT" if joint else "ROOT") and len(joints) < MOST_JOINTS:
            joints.append(_begun(words, joints, within))
            within = len(joints) - 1
        elif key == "MOTION" and joints and not joint:
            return joints
        elif key == "END" and joint:
            _read_end(words, joints, joint)
        elif key == "OFFSET" and joint:
            joint.offset = _offset(words)
        elif key == "CHANNELS" and joint:
            joint.channels = _channels(words, joint)
        elif word == "}" and joint:
            within = joint.parent
        else:
            raise _misplaced(words, word, joints)


def _begun(words: Words, joints: list[_Joint], parent: int) -> _Joint:
    """A joint below `parent`, read up to its brace."""
    name = _name(words)
    length = len(name) + (1 + joints[parent].path_length if parent >= 0 else 0)
    if length + sum(joint.path_length for joint in joints) > MOST_NAMES:
        raise words.error(f"has joint paths of more than {MOST_NAMES} characters", "shorten the names")
    return _Joint(name, parent, length, np.zeros(3))


def _read_end(words: Words, joints: list[_Joint], joint: _Joint) -> None:
    """The offset of a joint's end, a block that holds nothing else."""
    while words.next() != "{":
        pass
    while (word := words.next()) != "}":
        if word.upper() != "OFFSET":
            raise _misplaced(words, word, joints)
        joint.end = _offset(words)


def _offset(words: Words) -> np.ndarray:
    return np.array([words.number() for _ in range(3)])


def _channels(words: Words, joint: _Joint) -> tuple[str, ...]:
    channels = tuple(words.next().lower() for _ in range(words.count(6, "channels")))
    if len(set(channels)) != len(channels) or not set(channels) <= _CHANNELS:
        raise words.error(f"joint '{joint.name}' has channels {' '.join(channels)[:80]}")
    return channels


def _misplaced(words: Words, word: str, joints: list[_Joint]) -> NeuralocksError:
    if word.upper() in ("ROOT", "JOINT"):
        return words.error(f"joint {len(joints)} stands in a wrong place")
    return words.error(f"'{word[:40]}' stands in the hierarchy")


_CHANNELS = {f"{axis}{kind}" for axis in "xyz" for kind in ("position", "rotation")}


def _name(words: Words) -> str:
    """A joint's name: all words up to the brace, without characters that joint paths cannot hold."""
    parts = []
    while (word := words.next()) != "{":
        if len(parts) < LONGEST_NAME:
            parts.append(word)
    return "_".join(parts).replace("/", "_")[:LONGEST_NAME] or "joint"


def _motion_header(words: Words, joints: list[_Joint]) -> tuple[int, float]:
    words.label("Frames")
    width = sum(len(joint.channels) for joint in joints)
    if not width:
        raise words.error("no joint has a channel")
    frames = words.count(int(LARGEST), "frames")
    words.label("Frame Time")
    step = words.number()
    if not frames:
        raise words.error("holds no frame", "export the animated range")
    if frames * len(joints) > LARGEST_CLIP:
        raise words.error(f"{frames} frames of {len(joints)} joints are too many to hold", "cut the take")
    if not 1e-5 < step <= LONGEST_STEP:
        remedy = f"export it with the right rate, at most {LONGEST_STEP:g} s a frame"
        if 1 / LONGEST_STEP <= step <= 1000:
            remedy = f"write {1 / step:.6g} if that is frames a second"
            remedy += f", {step / 1000:.6g} if it is milliseconds" if step / 1000 <= LONGEST_STEP else ""
        raise words.error(f"has a frame time of {step:g} s", remedy)
    return frames, step


def _values(words: Words, frames: int, width: int) -> np.ndarray:
    values, more = words.numbers(frames * width) if frames * width <= words.left else ((), False)
    if len(values) < frames * width:
        raise words.error(f"says {frames} frames, of which it holds fewer")
    # A frame may go on in another line, and more frames may follow than are told; but no line holds a frame and a bit of another.
    if more and (held := words.in_longest_line()) > width:
        raise words.error(f"its joints have {width} channels, and a line of its frames holds {held} numbers")
    values = values.reshape(frames, width)
    bad = ~(np.abs(values) <= LARGEST).all(axis=1)
    if bad.any():
        raise words.error(f"frame {bad.argmax()} holds NaN or too large a number", "repair the take")
    return values


def _likely_unit(joints: list[_Joint], rest: np.ndarray, humanoid: Humanoid | None) -> float:
    """The unit in which the skeleton, with legs and trunk stretched out, is as tall as a person."""
    stands = AXES["Y"] if humanoid is None else standing_axis(rest, humanoid)
    # From the lowest end of any chain to the highest, along the bones: bent or spread rest poses count in full length.
    length, reach = np.zeros(len(joints)), np.zeros(len(joints))
    for i, joint in enumerate(joints):
        if joint.parent >= 0:
            length[i] = length[joint.parent] + np.linalg.norm(joint.offset)
        reach[i] = length[i] + (0 if joint.end is None else np.linalg.norm(joint.end))
    if stands is None:
        ends = [humanoid[name] for name in ("head", *FEET) if name in humanoid]
        height = reach[ends[0]] + max(reach[ends[1:]], default=0) - 2 * length[humanoid["hips"]]
    else:
        up = (rest - rest[0]) @ stands >= 0
        height = max(reach[up], default=0) + max(reach[~up], default=0)
    if not height > 0:
        return 1.0
    usual = [unit for unit in UNITS if 1.2 < 0.95 * height * unit < 2.4]
    return usual[0] if usual else 1.7 / height


def _rest(joints: list[_Joint]) -> np.ndarray:
    rest = np.zeros((len(joints), 3))
    for i, joint in enumerate(joints):
        rest[i] = joint.offset + (rest[joint.parent] if joint.parent >= 0 else 0)
    return rest


def _paths(joints: list[_Joint]) -> list[str]:
    paths: dict[str, None] = {}
    found: list[str] = []
    for i, joint in enumerate(joints):
        own = path = joint.name if joint.parent < 0 else f"{found[joint.parent]}/{joint.name}"
        while path in paths:  # the numbered name may belong to another joint, too
            path, i = f"{own}_{i}", i + 1
        paths[path] = None
        found.append(path)
    return found


def _forward(joints: list[_Joint], values: np.ndarray, unit: float) -> np.ndarray:
    """World transforms (T, J, 4, 4) [m]."""
    world = np.tile(np.eye(4), (len(values), len(joints), 1, 1))
    column = 0
    for i, joint in enumerate(joints):
        channels = values[:, column : column + len(joint.channels)]
        column += len(joint.channels)
        place = np.tile(joint.offset, (len(values), 1))
        axes, angles = "", []
        for k, channel in enumerate(joint.channels):
            if channel.endswith("position"):
                place[:, "xyz".index(channel[0])] = channels[:, k]
            else:
                axes += channel[0].upper()
                angles.append(channels[:, k])
        local = np.tile(np.eye(4), (len(values), 1, 1))
        local[:, :3, 3] = place * unit
        if axes:
            local[:, :3, :3] = Rotation.from_euler(axes, np.stack(angles, axis=-1), degrees=True).as_matrix()
        world[:, i] = local if joint.parent < 0 else world[:, joint.parent] @ local
    return world


def _first_of_motion(world: np.ndarray) -> int:
    """0, or 1 if the first frame is a T-pose from which the motion jumps away."""
    if len(world) < 4:
        return 0
    jump = angle_between(world[1:, :, :3, :3], world[:-1, :, :3, :3]).max(axis=1)
    return int(jump[0] > 0.3 and jump[0] > 4 * jump[1:].max())
