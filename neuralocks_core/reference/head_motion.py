# SPDX-License-Identifier: Apache-2.0
"""Motion between frames: the head's, which is rigid and smooth, and linear for all else, the body's as seen from the head."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation, RotationSpline

from neuralocks_core.arguments import is_whole, number_array
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.reference.arguments import check_pose


@dataclass(frozen=True, eq=False)
class HeadMotion:
    """Poses at all substeps, T frames with n substeps: N = (T - 1) n + 1."""

    turn: np.ndarray
    """(N, 4) quaternions, xyzw."""
    origin: np.ndarray
    """(N, 3) [m]."""


def head_motion(head: np.ndarray, substeps: int) -> HeadMotion:
    """Smooth the head's motion over substeps: rotations by a C2 spline, positions without overshoot.

    Args:
        head: (T, 4, 4) canonical -> world, rigid.
        substeps: at least 1.

    Raises:
        NeuralocksError: wrong shape, not finite, or not rigid.
    """
    head = number_array("head", head, "(T, 4, 4)")
    if head.ndim != 3 or head.shape[1:] != (4, 4) or len(head) == 0:
        raise NeuralocksError(f"head: shape {head.shape}; give (frames, 4, 4)")
    if not np.isfinite(head).all():
        raise NeuralocksError("head: holds values that are not finite; check the animation")
    linear = head[:, :3, :3]
    volume, square = np.linalg.det(linear), np.swapaxes(linear, 1, 2) @ linear
    off = np.where(volume < 0, np.inf, np.abs(square - np.eye(3)).max(axis=(1, 2)))
    if off.max() > 0.013:  # a scale of 0.65 %
        frame = int(np.argmax(off))
        raise NeuralocksError(
            f"head: frame {frame} scales, shears or mirrors (determinant {volume[frame]:.3g}); give rotations"
        )
    turns, origin = Rotation.from_matrix(head[:, :3, :3]), head[:, :3, 3]
    frames = len(head)
    if substeps == 1 or frames == 1:
        return HeadMotion(turns.as_quat(), origin.copy())
    at = np.arange((frames - 1) * substeps + 1) / substeps
    knots = np.arange(frames)
    return HeadMotion(RotationSpline(knots, turns)(at).as_quat(), PchipInterpolator(knots, origin)(at))


class SeenFromHead:
    """A body in the head's frame, where the skin of the head stays between frames. In the world, linear motion would lag behind a
    head that turns, or moves along a curve.

    Args:
        body: world points (V, 3) [m] of each frame; each is read once, in order.
        first: those of the first frame.
        way: of the head at all substeps.
        substeps: of a frame.
    """

    def __init__(self, body: Sequence[np.ndarray] | np.ndarray, first: np.ndarray, way: HeadMotion, substeps: int):
        self._body, self._vertices = body, len(first)
        self._turn, self._origin = Rotation.from_quat(way.turn[::substeps]).as_matrix(), way.origin[::substeps]
        self._seen = {0: self._from_head(first, 0)}

    def __getitem__(self, frame: int) -> np.ndarray:
        """Points (V, 3) float64 [m] of a frame, canonical.

        Raises:
            NeuralocksError: see `check_pose`.
        """
        if frame not in self._seen:
            points = self._from_head(check_pose("body", self._body[frame], self._vertices), frame)
            self._seen = {k: seen for k, seen in self._seen.items() if k == frame - 1} | {frame: points}
        return self._seen[frame]

    def _from_head(self, points: np.ndarray, frame: int) -> np.ndarray:
        return (points - self._origin[frame]) @ self._turn[frame]


def frames_without(head: np.ndarray, ahead: int) -> int:
    """How many of the head's frames are simulated, if the last ones, `ahead`, only shape its motion before.

    Raises:
        NeuralocksError: none is left, or it is no number of frames.
    """
    if not (is_whole(ahead) and 0 <= ahead < len(head)):
        raise NeuralocksError(
            f"ahead {ahead!r}: must be a whole number from 0 on, below the {len(head)} frames of head"
        )
    return len(head) - ahead


def between(values: Sequence[np.ndarray] | np.ndarray | SeenFromHead, step: int, substeps: int) -> np.ndarray:
    """What of T `values`, each one frame's, lies between those of the frames before and after a substep: linear."""
    frame, part = divmod(step, substeps)
    if part == 0:
        return np.asarray(values[frame])
    blend = part / substeps
    return (1 - blend) * np.asarray(values[frame]) + blend * np.asarray(values[frame + 1])
