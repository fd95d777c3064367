# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig's motion, sampled once: joint by joint translation, rotation and scale, as USD will store it.

Blender's matrices are converted at once to the float32 channels of a SkelAnimation, and everything else is computed from
these: the live view, the bake and the exported stage then see the same numbers.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from neuralocks_core.character import levels
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import loop_turns
from neuralocks_core.rotation import (
    Mirrored,
    from_parents,
    from_quaternion,
    inverses,
    rotation_part,
    sizes,
    to_quaternion,
)

from .uneven import ROUNDED, carriable, nearest, sheared, uneven

TOLERANCE = 1e-4
"""Transforms that differ by less than this (in matrix entries) are the same pose."""
KEPT_TO = float(np.finfo(np.float32).eps)
"""Relative precision of stored numbers: 2 km from the origin, it is as coarse as TOLERANCE."""


def same_pose(drawn: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Which transforms (..., 4, 4) are, up to rounding, those that were kept in single precision, (...)."""
    return (np.abs(drawn - kept) < TOLERANCE + KEPT_TO * np.abs(kept)).all(axis=(-2, -1))


def similar(joints: np.ndarray, subject: str = "armature") -> np.ndarray:
    """Transforms (..., 4, 4) with rotation, translation and one scale each, the mean of the scales along the axes.

    Raises:
        NeuralocksError: a transform is mirrored, flat or not finite; `subject` names it.
    """
    joints = np.asarray(joints, float)
    try:
        turn = rotation_part(joints, subject)
    except Mirrored:
        raise NeuralocksError(
            f"{subject}: it is mirrored (negative scale); apply its scale (Ctrl A in Object Mode)"
        ) from None
    scale = sizes(joints)
    result = joints.copy()
    result[..., :3, :3] = turn * scale[..., None, None]
    return result


def as_carried(head: np.ndarray, subject: str) -> np.ndarray:
    """A world transform (4, 4) of the head as it carries hair: unchanged if it is scaled unevenly."""
    even = similar(head, subject)
    return head if uneven(head, even) else even


def trim_of(bind: np.ndarray, subject: str) -> np.ndarray:
    """Per joint, the transform (J, 4, 4) that makes its bind transform a plain rotation and translation.

    Applied to bind and posed transforms alike it cancels; it keeps the scale of an object out of channels of half
    precision.
    """
    even = similar(bind, subject)
    size, some = sizes(even), uneven(bind, even)
    trim = np.zeros((len(bind), 4, 4))
    trim[:, [0, 1, 2], [0, 1, 2]] = 1 / size[:, None]
    trim[some, :3, :3] = inverses(bind[some])[:, :3, :3] @ (even[some, :3, :3] / size[some, None, None])
    trim[:, 3, 3] = 1
    return trim


def _matrices(translation, rotation, scale) -> np.ndarray:
    result = np.zeros((*translation.shape[:-1], 4, 4))
    result[..., :3, :3] = from_quaternion(rotation.astype(float)) * scale.astype(float)[..., None, :]
    result[..., :3, 3] = translation
    result[..., 3, 3] = 1
    return result


def _store(channels, rows: np.ndarray, joints: np.ndarray, parents: np.ndarray, evenly: bool = True) -> None:
    """Write translation, rotation and scale of some rows (T,) from world transforms (t, J, 4, 4), each relative to the
    parent as stored; all with one scale each, or not.
    """
    stored = np.empty((len(joints), len(parents) + 1, 4, 4))
    stored[:, -1] = np.eye(4)  # above a root, whose parent is -1
    for level in levels(parents):
        local, above = joints[:, level], parents[level]
        if above[0] >= 0:
            local = inverses(stored[:, above]) @ local
        if evenly:
            size = sizes(local)[..., None]
            turn = local[..., :3, :3] / size[..., None]
        else:
            size, turn = np.linalg.norm(local[..., :3, :3], axis=-2), np.empty((*local.shape[:2], 3, 3))
            lost = sheared(local, ROUNDED)
            turn[~lost] = rotation_part(local[~lost])
            turn[lost], size[lost] = nearest(stored[:, above][lost], joints[:, level][lost])
        size = np.broadcast_to(size, (*size.shape[:-1], 3)).astype(np.float16)  # a SkelAnimation's have half precision
        own = [each.astype(np.float32) for each in (local[..., :3, 3], to_quaternion(turn), size)]
        for channel, values in zip(channels, own, strict=True):
            channel[np.ix_(rows, level)] = values
        own = _matrices(*own)
        stored[:, level] = own if above[0] < 0 else stored[:, above] @ own


@dataclass(frozen=True, eq=False)
class Motion:
    """What was sampled of one armature, in Blender's world space and unit.

    Attributes:
        frames: ascending frame numbers, (T,), fractions for sub-frames.
        rate: frames per second.
        metres_per_unit: the scene's unit scale.
        parents: (J,).
        translation, rotation, scale: local channels, (T, J, 3), (T, J, 4) wxyz and (T, J, 3) float32.
        shape: values of the body's shape keys, (T, B) float32.
        places: world transforms (T, 4, 4) of the armature (key "") and of each hair and body object, by name.
    """

    frames: np.ndarray
    rate: float
    metres_per_unit: float
    parents: np.ndarray
    translation: np.ndarray
    rotation: np.ndarray
    scale: np.ndarray
    shape: np.ndarray
    places: dict[str, np.ndarray] = field(default_factory=dict)

    @classmethod
    def from_world(
        cls, frames, rate, metres_per_unit, parents, bind, joints, shape, subject="armature", head=None
    ) -> "Motion":
        """From world transforms.

        Channels are relative to the parent as stored, rounding included, so that rounding does not add up along the
        spine.

        Args:
            frames: (T,); rate: frames per second.
            metres_per_unit: the scene's.
            parents: (J,) int, -1 for a root.
            bind: world transforms of every joint in the bind pose, (J, 4, 4); joints: over time, (T, J, 4, 4).
            shape: blend shape weights (T, B).
            subject: name of the armature in messages.
            head: the joint that carries the hair, whose own transform counts most where bones are scaled unevenly.

        Raises:
            NeuralocksError: a transform is mirrored, flat or not finite.
        """
        trim, parents = trim_of(bind, subject), np.asarray(parents, int)
        joints = np.asarray(joints, float)
        whole = joints @ trim
        even = (
            similar(whole, subject) if uneven(bind, similar(bind, subject)).any() else similar(joints, subject) @ trim
        )
        some = uneven(whole, even).any(axis=1)
        channels = [np.empty((*even.shape[:2], size), np.float32) for size in (3, 4, 3)]
        if not some.all():
            _store(channels, ~some, even[~some], parents)
        if some.any():
            _store(channels, some, carriable(whole[some], even[some], parents, head), parents, False)
        translation, rotation, scale = channels
        return cls(
            frames=np.asarray(frames, float),
            rate=float(rate),
            metres_per_unit=float(metres_per_unit),
            parents=parents,
            translation=translation,
            rotation=rotation,
            scale=scale,
            shape=np.asarray(shape, np.float32),
        )

    @classmethod
    def joined(cls, parts, places) -> "Motion":
        """Parts of one motion, one after the other, with the world transforms (T, 4, 4) of other objects, by name."""
        channels = ("frames", "translation", "rotation", "scale", "shape")
        whole = {name: np.concatenate([getattr(part, name) for part in parts]) for name in channels}
        return replace(parts[0], places=dict(places), **whole)

    @property
    def times(self) -> np.ndarray:
        """(T,) [s]."""
        return self.frames / self.rate

    def world(self, rows=slice(None)) -> np.ndarray:
        """Joints (T, J, 4, 4) in Blender's world space, of all samples or of some, from the stored channels."""
        return from_parents(_matrices(self.translation[rows], self.rotation[rows], self.scale[rows]), self.parents)

    @cached_property
    def gap(self) -> float:
        """How far the last pose is from the first [degrees]: largest turn of any joint in the world. A loop has none."""
        return float(loop_turns(self.world([0, -1])).max(initial=0.0))

    def row(self, frame: float) -> int | None:
        """Index of the sample taken at `frame`, or None."""
        row = int(np.searchsorted(self.frames, frame - 1e-4))
        return row if row < len(self.frames) and abs(self.frames[row] - frame) < 1e-3 else None


def frame_numbers(start: int, end: int, subframes: int) -> np.ndarray:
    """Frames to sample from `start` to `end`, `subframes` per frame except the last, which has one, (T,).

    Raises:
        NeuralocksError: the range ends before it starts.
    """
    if end < start:
        raise NeuralocksError(f"frame range: it ends at {end}, before its start {start}; set an end after the start")
    return start + np.arange((end - start) * subframes + 1) / subframes
