# SPDX-License-Identifier: Apache-2.0
"""The numbers of the report card: plain functions of arrays, each with its definition.

Hair comes as points (T, S, K, 3) [m] in canonical space, where hair that is carried rigidly stands still, so that
all motion here is motion of the hair itself. `reference` is a trusted simulation of the same strands at the same
times. What does not fit together, such as a reference of other frames, is a NeuralocksError: numpy would repeat it.
"""

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.metric_arguments import ascending, counts_of, edges_of, hair_of, reals, rows_of, shaped

DYNAMIC_SHARE = 0.35
"""A frame counts as dynamic if hair moves at least at this share of the reference's speed (Neuroll, table 1)."""
STILL = 0.01
"""Mean speed [m/s] under which the reference itself counts as standing still."""
MOTIONLESS = 1e-4
"""Mean speed [m/s] of the reference over a clip below which nothing can be measured relative to its motion."""
ROUNDING = 2e-6
"""How far rounding may push a vertex [m]: the spacing of float32 coordinates 20 m from the origin."""
DEEP = 0.003
"""Depth [m] at which a vertex inside the body begins to show."""
LIVELY = 0.005
"""A strand moves if the rms of its motion is more than this share of its length."""
SETTLED = 0.1
"""Hair has settled when its tips stay below this share of their largest speed, or below STILL if that is more."""
HELD = 1e-5
"""Transforms that change by less than this in HELD_TIME [s] belong to a held pose."""
HELD_TIME = 1 / 24
QUIET_AFTER = 2.0
"""A pose held for this long [s] should have still hair."""


def strand_lengths(points: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Length [m] of each strand, (..., S), for points (..., P, 3) in strands of `counts` (S,) vertices."""
    edges = np.linalg.norm(edges_of(points), axis=-1)
    counts = counts_of(counts, np.shape(points)[-2])
    ends = np.cumsum(counts)
    total = np.concatenate([np.zeros((*edges.shape[:-1], 1)), np.cumsum(edges, axis=-1)], axis=-1)
    last = np.clip(ends - 1, 0, None)
    return np.where(counts > 1, total[..., last] - total[..., np.clip(ends - counts, 0, last)], 0.0)


def stretch(lengths: np.ndarray, rest: np.ndarray) -> dict[str, float]:
    """How far strands are from their rest length.

    Args:
        lengths: (T, S) [m].
        rest: (S,) [m]; strands without length are left out.

    Returns:
        `stretch_cm`, the mean of |L - L0| in cm (Neuroll's stretch violation); `stretch_percent` and
        `stretch_percent_max`, mean and largest |L - L0| / L0.
    """
    lengths, rest = rows_of("lengths", lengths, "rest", rest)
    real = rest > 1e-6
    off = np.abs(np.asarray(lengths, float)[..., real] - rest[real])
    return {
        "stretch_cm": _mean(100 * off),
        "stretch_percent": _mean(100 * off / rest[real]),
        "stretch_percent_max": float(np.max(100 * off / rest[real], initial=0.0)),
    }


def penetration(distance: np.ndarray, rest_distance: np.ndarray) -> dict[str, float]:
    """Vertices inside the body.

    A vertex that rests inside the body is the author's choice: it counts only if it is deeper than at rest.

    Args:
        distance: signed distance to the posed body (T, N) [m], negative inside; clamped root vertices left out.
        rest_distance: the same at rest (N,) [m].

    Returns:
        `penetration_percent`, `penetration_3mm_percent`: share of vertices inside, and deeper than 3 mm;
        `penetration_worst_mm`; `inside_at_rest_percent`: how many vertices the author put inside. NaN if a distance is.
    """
    distance, rest_distance = rows_of("distance", distance, "rest_distance", rest_distance)
    depth = np.maximum(np.minimum(rest_distance, 0) - distance, 0.0)
    worst = float(np.max(depth, initial=0.0))

    def share(inside: np.ndarray) -> float:
        return float("nan") if np.isnan(worst) else 100 * _mean(inside)  # NaN compares false, as if outside

    return {
        "penetration_percent": share(depth > ROUNDING),
        "penetration_3mm_percent": share(depth > DEEP),
        "penetration_worst_mm": 1000 * worst,
        "inside_at_rest_percent": share(rest_distance < 0),
    }


def speed(points: np.ndarray, times: np.ndarray, cuts: np.ndarray = ()) -> np.ndarray:
    """Speed (T - 1, S, K) [m/s] of every vertex between consecutive times (T,) [s]. Where hair starts anew, at times `cuts` (C,), its
    jump is no motion: two times before and after one of them have no speed, and are left out.
    """
    points, times = hair_of(times, points=points)
    cuts = np.sort(shaped("cuts", cuts, "(C,) seconds", None)) - 1e-9
    kept = np.flatnonzero(np.diff(np.searchsorted(cuts, times, side="right")) == 0)
    far = np.empty((len(kept), *points.shape[1:-1]), np.result_type(points, np.float32))
    for row, frame in enumerate(kept):  # all differences at once would be as large as all points
        far[row] = np.linalg.norm(points[frame + 1] - points[frame], axis=-1)
    return far / np.diff(times)[kept, None, None]


def velocity_error(points: np.ndarray, reference: np.ndarray, times: np.ndarray, cuts: np.ndarray = ()) -> float:
    """Mean length of the velocity's error over the mean length of the reference's velocity; 1 for rigid hair. NaN if the reference
    is MOTIONLESS.
    """
    points, reference = hair_of(points=points, reference=reference)
    return _relative(speed(points.astype(float, copy=False) - reference, times, cuts), speed(reference, times, cuts))


def motion_ratio(points: np.ndarray, reference: np.ndarray, times: np.ndarray, cuts: np.ndarray = ()) -> float:
    """Mean speed over the reference's mean speed: 0 for rigid hair, 1 for hair as lively as the reference, even if the motion is a
    different one. NaN if the reference is MOTIONLESS.
    """
    points, reference = hair_of(points=points, reference=reference)
    return _relative(speed(points, times, cuts), speed(reference, times, cuts))


def dynamic_frames(points: np.ndarray, reference: np.ndarray, times: np.ndarray, cuts: np.ndarray = ()) -> int:
    """Longest run of consecutive samples (a frame may have several) in which hair moves at 35 % of the reference's mean speed or
    more.

    Samples at which the reference stands still neither count nor break a run.
    """
    hair = hair_of(points=points, reference=reference)
    own, true = (speed(each, times, cuts).mean(axis=(1, 2)) for each in hair)
    moving = true >= STILL
    best = run = 0
    for alive in own[moving] >= DYNAMIC_SHARE * true[moving]:
        run = run + 1 if alive else 0
        best = max(best, run)
    return best


def position_error(points: np.ndarray, reference: np.ndarray, length: np.ndarray) -> float:
    """Mean distance of a vertex from the reference's, in percent of its strand's length (S,) [m]."""
    points, reference, length = hair_of(length=length, points=points, reference=reference)
    off = np.linalg.norm(points.astype(float, copy=False) - reference, axis=-1)
    return 100 * _mean(off / np.maximum(length, 1e-6)[:, None])


def motion_error(points: np.ndarray, reference: np.ndarray, length: np.ndarray) -> dict[str, float]:
    """Error of each strand's motion relative to that of hair carried rigidly (= 1).

    The motion of a vertex is its position relative to its mean over the clip, so a wrong droop alone is not an error of motion.
    Per strand: rms over time and vertices of the motion's error, over the rms of the reference's motion. Strands that
    move less than LIVELY have no motion to compare and are left out.

    Returns:
        `median` over strands, and `p95`, which one strand in twenty exceeds; `rms`: the same ratio over all strands
        together, dominated by the few that came to rest elsewhere. NaN if nothing moves, or if hair or reference hold NaN.
    """
    points, reference = hair_of(points=points, reference=reference)
    error, true = swings(points.astype(float, copy=False), reference.astype(float, copy=False), length)
    if not len(true):
        return dict.fromkeys(("median", "p95", "rms"), float("nan"))
    each = error / true
    return {
        "median": float(np.median(each)),
        "p95": float(np.percentile(each, 95)),
        "rms": float(np.sqrt(np.square(error).sum() / np.square(true).sum())),
    }


def swings(points: np.ndarray, reference: np.ndarray, length: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The parts of `motion_error`: rms of the motion's error and of the reference's motion (n,) [m] of each strand that
    moves by more than LIVELY of its length (S,) [m].
    """
    points, reference, length = hair_of(length=length, points=points, reference=reference)
    error, true = _swing(points - reference), _swing(reference)
    lively = ~(true <= LIVELY * length)  # with those that are NaN: where they are left out, nobody would know
    return error[lively], true[lively]


def settling_time(points: np.ndarray, times: np.ndarray, stop: float) -> float:
    """Time [s] after `stop` until the mean tip speed stays below SETTLED of its largest value after the stop, or below STILL if that
    is more.

    Tips that never exceed the speed STILL have settled at once; for tips that never settle, it is the time left. NaN if points are,
    or if no two times come after the stop: nothing is known then.
    """
    points, times = hair_of(times, points=points)
    stop = shaped("stop", stop, "a number of seconds")
    tips = speed(points[:, :, -1:], times).mean(axis=(1, 2))
    middle = (times[1:] + times[:-1]) / 2
    after = middle >= stop
    peak = tips[after].max(initial=0.0) if after.any() else np.nan
    if np.isnan(peak):
        return float("nan")
    if peak < STILL:
        return 0.0
    loud = np.flatnonzero(after & (tips > max(SETTLED * peak, STILL)))
    return float(times[loud[-1] + 1] - stop) if len(loud) else 0.0


def echo(points: np.ndarray, reference: np.ndarray, times: np.ndarray, stop: float) -> float:
    """Mean speed of the tips between half a second and two seconds after `stop`, in percent of the largest speed of the reference's
    tips after it: motion that returns when hair should come to rest. For `points - reference`, it is the share of that motion that
    is wrong.
    """
    *hair, times = hair_of(times, points=points, reference=reference)
    stop = shaped("stop", stop, "a number of seconds")
    tips, true = (speed(p[:, :, -1:], times).mean(axis=(1, 2)) for p in hair)
    since = (times[1:] + times[:-1]) / 2 - stop
    later = (since >= 0.5) & (since < 2.0)
    peak = true[since >= 0].max(initial=0.0)
    return 100 * float(tips[later].mean() / peak) if later.any() and peak > STILL else float("nan")


def turning(points: np.ndarray) -> float:
    """Mean angle [degrees] between successive edges of strands (..., K, 3): what makes hair look smooth, curly or crinkled."""
    edges = edges_of(points)
    before, after = edges[..., :-1, :], edges[..., 1:, :]
    across = np.linalg.norm(np.cross(before, after), axis=-1)
    along = np.einsum("...i,...i->...", before, after)
    return _mean(np.degrees(np.arctan2(across, along)))


def jitter(points: np.ndarray) -> float:
    """Largest distance [mm] that a vertex goes from one frame to the next in a held pose: 0 if nothing moves."""
    points = reals("points", points, "(T, ..., 3) metres")
    if points.ndim < 2 or points.shape[-1] != 3 or not len(points):
        raise NeuralocksError(f"points: are of shape {points.shape}; give frames of hair, (T, ..., 3)")
    return 1000 * float(np.linalg.norm(np.diff(points, axis=0), axis=-1).max(initial=0.0))


def droop(displacement: np.ndarray, down: np.ndarray) -> float:
    """How far tips hang below those of the rigid groom, mean over strands and frames [cm].

    Args:
        displacement: (T, S, K, 3) [m] canonical.
        down: unit vectors of gravity in canonical axes, (T, 3).
    """
    (displacement,) = hair_of(displacement=displacement)
    down = shaped("down", down, f"a unit vector for each of {len(displacement)} frames", len(displacement), 3)
    return 100 * _mean(np.einsum("tsi,ti->ts", displacement[:, :, -1].astype(float, copy=False), down))


def tip_curves(displacement: np.ndarray) -> np.ndarray:
    """Mean displacement of the tips (T, 3) [m] in canonical space: the curve that a person compares."""
    (displacement,) = hair_of(displacement=displacement)
    return displacement[:, :, -1].astype(float, copy=False).mean(axis=1)


def held(joints: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Which samples (T,) have the pose of the one before: none of the given transforms (T, n, 4, 4) changes.

    Nor does any within HELD_TIME before or after, times (T,) [s]: with many samples per frame, each changes little in slow motion.
    """
    joints = shaped("joints", joints, "(T, n, 4, 4) transforms", None, None, 4, 4)
    if not joints.size:
        raise NeuralocksError(f"joints: are of shape {joints.shape}; give one transform or more")
    times = ascending(times, len(joints))
    rows = np.arange(len(times))
    before = np.searchsorted(times, times - HELD_TIME + 1e-9, side="right") - 1
    after = np.searchsorted(times, times + HELD_TIME - 1e-9)

    def alike(first, second):
        return np.abs(joints[second] - joints[first]).max(axis=(1, 2, 3)) < HELD

    since = (before >= 0) & alike(np.maximum(before, 0), rows)
    stays = (after < len(times)) & alike(rows, np.minimum(after, len(times) - 1))
    return np.concatenate([[False], alike(rows[:-1], rows[1:]) & (stays[:-1] | since[1:])])


def _swing(points: np.ndarray) -> np.ndarray:
    """(S,) rms over time and vertices of points (T, S, K, 3) about their mean in time [m]."""
    return np.sqrt(np.square(points - points.mean(axis=0)).sum(axis=-1).mean(axis=(0, 2)))


def _relative(own: np.ndarray, true: np.ndarray) -> float:
    """Mean over mean of speeds [m/s]; NaN if the second mean is too small to divide by."""
    return float(own.mean() / true.mean()) if _mean(true) >= MOTIONLESS else float("nan")


def _mean(values) -> float:
    values = np.asarray(values, float)
    return float(values.mean()) if values.size else 0.0
