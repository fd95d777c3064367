# SPDX-License-Identifier: Apache-2.0
"""The lowest error that a method without memory can have: that of the reference itself, restarted."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from neuralocks_core.arguments import is_whole
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.metric_arguments import shaped
from neuralocks_core.metrics import motion_error, position_error
from neuralocks_core.progress import Progress
from neuralocks_core.reference.head_motion import frames_without
from neuralocks_core.reference.solver import simulate


@dataclass(frozen=True)
class Floor:
    """Error of the restarted reference relative to the continuous one, at the compared frames."""

    history: int
    """Frames that the restarted reference knows."""
    frames: np.ndarray
    """The compared frames."""
    median: float
    """Motion error of the median strand, relative to hair carried rigidly (= 1)."""
    rms: float
    """The same over all strands together, dominated by those that came to rest elsewhere."""
    position_percent: float
    """Mean distance in percent of strand length."""


def stateless_floor(
    rest: np.ndarray,
    head: np.ndarray,
    body: Sequence[np.ndarray] | np.ndarray | None = None,
    triangles: np.ndarray | None = None,
    material: Any = None,
    *,
    history: int,
    every: int = 10,
    truth: np.ndarray | None = None,
    wind: np.ndarray | None = None,
    ahead: int = 0,
    progress: Progress | None = None,
    **options: Any,
) -> Floor:
    """Restart the reference at rest `history` frames before each compared frame, and compare.

    Hair that slid over a shoulder stays there; a method that sees only the last N frames cannot know it. A network whose
    error is near this one has nothing left to learn (docs/architecture.md, Reference). The cost is `history / every`
    times that of a simulation.

    Args:
        rest, head, body, triangles, material, wind, ahead: as in `simulate`.
        history: frames of motion that the method may see.
        every: compare every n-th frame, from `history` on.
        truth: (T, S, K, 3) points of `simulate` over the whole clip, if available.
        progress: called with restarts done, all restarts, message.
        options: of `simulate`; the same for both.

    Raises:
        NeuralocksError: history or every is no whole number, the clip is not longer than the history, truth is of other frames or
            strands, or the errors of `simulate`.
    """
    count, options["ahead"] = frames_without(head, ahead), ahead
    if not is_whole(history) or not is_whole(every):
        raise NeuralocksError(f"history {history!r}, every {every!r}: give whole numbers of frames")
    if history < 1 or every < 1 or count <= history + every:
        raise NeuralocksError(
            f"head: {count} frames for a history of {history} looked at every {every}; give a longer clip"
        )
    if truth is not None:
        truth = shaped("truth", truth, "(T, S, K, 3) points of `simulate` over the whole clip", count, *np.shape(rest))
    else:
        truth = simulate(rest, head, body, triangles, material, wind=wind, **options).points
    if body is not None and options.get("bind_body") is None:
        # else each restart would measure the rest distances on its own first pose
        first = np.asarray(head[0], float)
        options["bind_body"] = (np.asarray(body[0]) - first[:3, 3]) @ first[:3, :3]
    frames = np.arange(history, count, every)
    forgetful = np.empty((len(frames), *np.shape(rest)), np.float32)
    for i, frame in enumerate(frames):
        span = slice(frame - history, frame + 1)
        near, blown = (None if each is None else each[span] for each in (body, wind))
        way = head[span.start : span.stop + ahead]
        forgetful[i] = simulate(rest, way, near, triangles, material, wind=blown, **options).points[-1]
        if progress:
            progress(i + 1, len(frames), "restarting")
    length = np.linalg.norm(np.diff(rest, axis=1), axis=-1).sum(1)
    error = motion_error(forgetful - rest, truth[frames] - rest, length)
    position = position_error(forgetful - rest, truth[frames] - rest, length)
    return Floor(history, frames, error["median"], error["rms"], position)
