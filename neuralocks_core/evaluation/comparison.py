# SPDX-License-Identifier: Apache-2.0
"""Hair beside a trusted simulation of the same strands: the second half of the report card."""

from collections.abc import Sequence

import numpy as np

from neuralocks_core import metrics
from neuralocks_core.boundary.history import joints_read
from neuralocks_core.boundary.smooth_motion import SmoothMotion
from neuralocks_core.boundary.stepped import Stepped
from neuralocks_core.boundary.unscaled import unscaled
from neuralocks_core.character import Character
from neuralocks_core.deformation.resolve import Resolver
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import Material
from neuralocks_core.motion import Clip
from neuralocks_core.progress import Progress, silent, within
from neuralocks_core.skinned_body import Body
from neuralocks_core.strands.locks import lock_mates
from neuralocks_core.strands.strand_set import StrandSet
from neuralocks_core.wind import Wind

STEP = 1 / 30
"""Time step of the reference [s]: the one that models are trained on."""
CROWDED_STEPS = 2
"""Substeps of a step with a volume term: its force is updated between Newton solves only, so that whole steps are less exact."""
AHEAD = 24
"""Steps beyond the last one that shape the head's motion over substeps: of a spline's end, so far away, nothing is left."""
RUN_IN = 10.0
"""Time [s] after which earlier motion has died away: a loop's hair, simulated from rest for this long, ends a period where it
began, except for millimetres in a few strands that creep over skin."""
BLOWN = 3.0
"""Time [s] after which hair remembers no earlier gusts."""
MOST_STEPS = 10_000
"""Over five minutes; a whole rollout is held in memory."""
TOGETHER = 32
"""Strands whose rollout is interpolated at a time."""


def compare(
    answer: np.ndarray, reference: np.ndarray, length: np.ndarray, times: np.ndarray, cuts: np.ndarray = ()
) -> dict[str, float]:
    """All measures of an answer against the reference.

    Args:
        answer, reference: displacements from rest (T, S, 24, 3) [m], canonical.
        length: of the strands (S,) [m].
        times: (T,) [s].
        cuts: times at which hair starts anew (C,) [s].

    Returns:
        Measures by the keys of `report.LABELS`, which has their units and remarks.
    """
    error = metrics.motion_error(answer, reference, length)
    return {
        "position_percent": metrics.position_error(answer, reference, length),
        "tip_percent": metrics.position_error(answer[:, :, -1:], reference[:, :, -1:], length),
        "motion_error_median": error["median"],
        "motion_error_p95": error["p95"],
        "motion_error_rms": error["rms"],
        "velocity_error": metrics.velocity_error(answer, reference, times, cuts),
        "motion_ratio": metrics.motion_ratio(answer, reference, times, cuts),
        "dynamic_frames": metrics.dynamic_frames(answer, reference, times, cuts),
        "tip_correlation": _correlation(metrics.tip_curves(answer), metrics.tip_curves(reference)),
    }


def simulated(
    character: Character,
    strands: StrandSet,
    clip: Clip,
    times: np.ndarray,
    material: Material | None = None,
    *,
    wind: Wind | None = None,
    volume: float = 0.0,
    xpbd: int | None = None,
    device: str = "cpu",
    residuals: list[float] | None = None,
    progress: Progress | None = None,
) -> np.ndarray:
    """The reference's displacement (T, S, 24, 3) float32 [m] at ascending times (T,), canonical.

    It runs at its own step from the first time on, restarts at each cut, and is interpolated in between. The motion that
    it feels is smooth between the clip's samples, as the network reads it.

    Args:
        character: with its body.
        strands: all valid.
        clip: the motion. For a loop, the first time should be RUN_IN before the second.
        times: (T,) [s].
        material: of the hair.
        wind: that blows all the time.
        volume: stiffness against strands crowding closer than at rest [m^2/s^2]; models are trained without.
        xpbd: XPBD with so many substeps in a step of the solver, instead of the implicit solver; it starts from that one's
            equilibrium, and has neither a volume term nor ties within locks.
        device: "cpu", "cuda" or "cuda:N".
        residuals: to which what the solver left is added for each of its steps, see `SimulatedHair.residual`.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: the solver is not installed, lacks the device, or would take more than MOST_STEPS.
    """
    steps = np.ceil((times[-1] - times[0]) / STEP - 1e-9)
    if not steps <= MOST_STEPS:
        raise NeuralocksError(
            f"frames: the solver goes from {times[0]:g} s to {times[-1]:g} s, {steps:g} steps, but {MOST_STEPS} are "
            "the most; choose frames near the animation, or fewer"
        )
    parts = clip.parts
    part = np.searchsorted([p.start - 1e-9 for p in parts[1:]], times, side="right")
    # Times after a part's end are simulated apart: those before it must not depend on whether later ones are wanted.
    run = 2 * part + (False if clip.loop else times > np.array([p.end for p in parts])[part] + 1e-9)
    options = {"wind": wind, "volume": volume, "xpbd": xpbd, "device": device, "residuals": residuals}
    result, runs = np.empty((len(times), *strands.rest.shape), np.float32), np.unique(run)
    for number, each in enumerate(runs):
        i, rows = each // 2, slice(*np.searchsorted(run, [each, each + 1]))  # times ascend, and so do runs
        start = times[0] if i == part[0] else parts[i].start
        say = within(progress or silent, 1000 * number // len(runs), 1000 * (number + 1) // len(runs))
        _from(start, character, strands, parts[i], times[rows], result[rows], material, **options, progress=say)
    return result


def _from(
    start: float, character, strands, clip, times, into, material, *, wind, volume, xpbd, device, residuals, progress
) -> None:
    """The same as `simulated`, for a clip without cuts, with hair at rest at `start` [s]; written `into` (T, S, 24, 3): for minutes
    of motion, each copy takes gigabytes.
    """
    from neuralocks_core.reference import simulate, simulate_xpbd

    stepped = Stepped.of(clip, joints_read(character))
    clip, start, times = stepped.clip, stepped.times(np.array([start]))[0], stepped.times(times)
    substeps = xpbd or (CROWDED_STEPS if volume else 1)
    ahead = AHEAD if substeps > 1 else 0
    # One step more than the last time needs, so that interpolation there is the same for any wanted times.
    steps = int(np.ceil((times[-1] - start) / STEP - 1e-9)) + 2
    clock = start + STEP * np.arange(steps + ahead)
    joints = unscaled(character, _without_stop(character, clip, clock, times[-1]))
    head, clock, joints = character.canonical_to_world(joints), clock[:steps], joints[:steps]
    shapes = clip.shape_at(clock)
    resolver = Resolver(character, strands, clip)  # for the part of the body that the hair can reach
    body = triangles = bind = None
    if resolver.at_rest is not None:
        body = _PosedBody(resolver.body, joints @ character.inverse_bind, shapes)
        triangles, bind = resolver.body.triangles, resolver.at_rest.points
    rest, look, blown = strands.rest, material or Material(), wind and wind.at(clock, clip.period)
    alike = {"dt": STEP, "bind_body": bind, "device": device}
    how = {"substeps": substeps, "ahead": ahead, "wind": blown, "progress": progress, **alike}
    if xpbd:
        here, blowing = body and [body[0]], None if blown is None else blown[:1]
        held = simulate(rest, head[:1], here, triangles, look, wind=blowing, **alike)
        rollout = simulate_xpbd(rest, head, body, triangles, look, start=held.points[0], **how)
    else:
        ties = lock_mates(rest, strands.lock)
        rollout = simulate(rest, head, body, triangles, look, neighbours=ties, volume=volume, **how)
    if residuals is not None:
        residuals += rollout.residual.tolist()
    _between(clock, rollout.points, times, into)
    into -= strands.rest


def _without_stop(character: Character, clip: Clip, clock: np.ndarray, last: float) -> np.ndarray:
    """World joint transforms (C, J, 4, 4) at times `clock` (C,) [s]. If times within the clip are wanted, steps past its end continue
    with its last velocity: between steps, hair would feel a stop before it comes.
    """
    motion = SmoothMotion(character, clip)
    joints = motion.at(clock)
    if not clip.loop and last <= clip.end + 1e-9:
        before, end = character.head_place(motion.at(clip.end - np.array([STEP, 0.0])))
        joints[..., :3, 3] += (np.maximum(clock - clip.end, 0)[:, None] * (end - before) / STEP)[:, None]
    return joints


class _PosedBody(Sequence):
    """World points (V, 3) [m] of a body in each of T frames, posed on access: for minutes of motion, all together take gigabytes.

    Args:
        body: the part that hair can reach.
        skinning: (T, J, 4, 4).
        shapes: blend shape weights (T, B).
    """

    def __init__(self, body: Body, skinning: np.ndarray, shapes: np.ndarray):
        self._body, self._skinning, self._shapes = body, skinning, shapes

    def __len__(self) -> int:
        return len(self._skinning)

    def __getitem__(self, frame: int) -> np.ndarray:
        return self._body.posed(self._skinning[frame], self._shapes[frame])


def _between(clock: np.ndarray, points: np.ndarray, times: np.ndarray, into: np.ndarray) -> None:
    """Points `into` (T, S, 24, 3) float32 at times (T,), all within `clock` (C,), from points (C, S, 24, 3) at the clock's times:
    cubics whose slopes are those of a parabola through each point and its neighbours.
    """
    from scipy.interpolate import CubicHermiteSpline

    order = min(2, len(clock) - 1)
    for low in range(0, points.shape[1], TOGETHER):
        some = points[:, low : low + TOGETHER].astype(float)
        slopes = np.gradient(some, STEP, axis=0, edge_order=order)
        into[:, low : low + TOGETHER] = CubicHermiteSpline(clock, some, slopes)(times)


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Correlation of two curves (T, 3) about their means."""
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    both = np.sqrt(np.square(a).sum() * np.square(b).sum())
    return float((a * b).sum() / both) if both > 1e-12 else float("nan")
