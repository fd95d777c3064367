# SPDX-License-Identifier: Apache-2.0
"""The trusted simulator: implicit, inextensible rods on the network's own energies."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from neuralocks_core.arguments import flag
from neuralocks_core.materials import COLLISION, MARGIN
from neuralocks_core.motion import G
from neuralocks_core.progress import Progress
from neuralocks_core.reference.arguments import (
    check_amounts,
    check_body,
    check_material,
    check_neighbours,
    check_pose,
    check_settings,
    check_start,
    check_wind,
)
from neuralocks_core.reference.head_motion import HeadMotion, SeenFromHead, between, frames_without, head_motion
from neuralocks_core.reference.rest import RestRods, rest_rods

INTEGRATOR = "BDF2"
"""How the solver steps in time: what was simulated in another way has other motion."""
SETTLE_DT = tuple(1 / 30 * 1.5**i for i in range(14))
"""[s] growing steps of a gradient flow that finds the equilibrium before the first frame."""
CROWDED, AT_REST = 30, 1e-4
"""With a volume term, most such searches, until one moves no vertex by more than this [m]."""


@dataclass(frozen=True, eq=False)
class SimulatedHair:
    """T frames of S simulated strands, in canonical space, so without the head's own motion."""

    points: np.ndarray
    """(T, S, K, 3) float32 [m]."""
    planes: np.ndarray | None
    """(T, S, K, 4) float32: body plane n, d nearest to each vertex, n.x - d its signed distance [m]; NO_PLANE if
    it is farther than 2 cm. None if not requested."""
    residual: np.ndarray
    """(T,) rms over strands and vertices of the remaining net force per mass, in 9.81 m/s^2 whatever the gravity, with neighbours
    and body planes as last updated. Solved strands are below `tolerance`; one that no Newton step improves, such as a fold, counts
    without the tension in its edges, so with about its weight, however near it is."""
    iterations: np.ndarray
    """(T,) mean Newton steps per strand for the frame."""


def simulate(
    rest: np.ndarray,
    head: np.ndarray,
    body: Sequence[np.ndarray] | np.ndarray | None = None,
    triangles: np.ndarray | None = None,
    material: Any = None,
    *,
    dt: float = 1 / 30,
    substeps: int = 1,
    ahead: int = 0,
    iterations: int = 10,
    tolerance: float = 1e-3,
    rest_support: bool = True,
    neighbours: np.ndarray | None = None,
    start: np.ndarray | None = None,
    bind_body: np.ndarray | None = None,
    margin: float = MARGIN,
    collision: float = COLLISION,
    gravity: float = G,
    wind: np.ndarray | None = None,
    volume: float = 0.0,
    planes: bool = False,
    device: str = "cpu",
    progress: Progress | None = None,
) -> SimulatedHair:
    """Simulate strands on a moving head and body, implicitly, by second backward differences (BDF2; Choi and Ko 2002, "Stable but
    Responsive Cloth"; docs/architecture.md, Reference).

    Before the first frame the head moves at constant velocity without rotating and the hair is at rest relative to it. Any
    motion is stable: lengths are exact by construction and every step lowers an energy. The time step's error is of second order
    if hair starts in equilibrium, so that it damps motion by next to nothing, unlike implicit Euler's. A volume term makes steps less
    exact, which the residual does not show: take several substeps, and compare.

    Args:
        rest: (S, K, 3) canonical rest points [m]; vertices 0 and 1 are clamped to the head.
        head: (T, 4, 4) canonical -> world, rigid, one per frame.
        body: (T, V, 3) world points [m] of the body, or None for no contact; each frame is read once, in order.
            Over substeps, it moves linearly as seen from the head.
        triangles: (F, 3) of the body, outward (counter-clockwise), closed where hair may touch it.
        material: object or mapping with bend, weight, damping, clumping, each a number or (S,); None: `Material()`.
        dt: time between frames [s].
        substeps: steps per frame.
        ahead: so many of head's last frames are not simulated, so that T is less by them elsewhere: they only shape its motion
            over the substeps before.
        iterations: most Newton steps per step.
        tolerance: a strand is solved when the rms net force is below this fraction of its weight.
        rest_support: bind pose is an equilibrium.
        neighbours: (S, N) int strands whose corresponding vertices are tied to this one's (clumping), -1 for none.
        start: (S, K, 3) canonical points at the first frame, clamped and as long as at rest; None: the equilibrium of the first
            pose, searched from the rest shape.
        bind_body: (V, 3) canonical body in bind pose, for the distance at rest; None: taken from the first frame.
        margin: distance kept from the body [m], or a vertex's own distance at rest if that is less.
        collision: stiffness of the contact [1/(m s^2)].
        gravity: [m/s^2].
        wind: acceleration (T, 3) of all hair in each frame, in world axes [m/s^2]; it is linear between frames.
        volume: stiffness against strands crowding closer than at rest [m^2/s^2], 0 for none; see `volume`.
        planes: return the body planes, which take more memory than the points.
        device: "cpu", "cuda" or "cuda:N".
        progress: called with frames done, all frames, message.

    Raises:
        NeuralocksError: unsuitable shapes, values or device; the message names the argument.
    """
    planes, rods = flag("planes", planes), rest_rods(rest, rest_support=rest_support)
    strands, vertices = rods.mass.shape
    check_settings(dt, margin, gravity, substeps=substeps, iterations=iterations)
    check_amounts(volume=volume, collision=collision, tolerance=tolerance)
    way, frames = head_motion(head, substeps), frames_without(head, ahead)
    # relative to the head's first position: far from the world's origin, rounding would dominate
    near = replace(way, origin=way.origin - way.origin[0])
    material, wind = check_material(material, strands), check_wind(wind, frames)
    result = _empty_rollout(frames, strands, vertices, planes)
    if strands == 0:
        return result
    start = check_start(start, rods)
    from neuralocks_core.reference.stepper import Stepper

    stepper = Stepper(
        rods,
        material,
        check_neighbours(neighbours, strands),
        margin=margin,
        collision=collision,
        gravity=gravity,
        tolerance=tolerance * gravity,
        volume=volume,
        device=device,
    )
    if body is not None:
        first, faces = check_body(body, triangles, frames)
        seen = SeenFromHead(body, first, way, substeps)
        stepper.attach_body(check_pose("bind_body", seen[0] if bind_body is None else bind_body, len(first)), faces)
        stepper.move_body(seen[0])
    stepper.blow(wind[0])
    _begin(stepper, near, rods, start, iterations, volume > 0)
    for frame in range(frames):
        steps = [] if frame == 0 else range((frame - 1) * substeps + 1, frame * substeps + 1)
        for step in steps:
            if body is not None:
                stepper.move_body(between(seen, step, substeps))
            stepper.blow(between(wind, step, substeps))
            stepper.step(near.turn[step], near.origin[step], dt / substeps, iterations)
        left = stepper.read(result.points[frame], result.planes[frame] if planes else None)
        result.residual[frame], result.iterations[frame] = left
        if progress:
            progress(frame + 1, frames, "simulating")
    return result


def _empty_rollout(frames: int, strands: int, vertices: int, planes: bool) -> SimulatedHair:
    """Arrays to fill."""
    points = np.zeros((frames, strands, vertices, 3), np.float32)
    near = np.zeros((*points.shape[:3], 4), np.float32) if planes else None
    return SimulatedHair(points, near, np.zeros(frames), np.zeros(frames))


def _begin(stepper, way: HeadMotion, rods: RestRods, start: np.ndarray | None, iterations: int, crowded: bool) -> None:
    """Put hair at its start, by default in the equilibrium of the first pose, moving along with the head."""
    stepper.begin(way.turn[0], way.origin[0], rods.points if start is None else start)
    if start is None:
        for _ in range(CROWDED if crowded else 1):  # strands that push each other apart move a little at a time
            begun = stepper.x.numpy().copy()
            stepper.settle(SETTLE_DT, iterations)
            if np.abs(stepper.x.numpy() - begun).max(initial=0.0) < AT_REST:
                break
    before = way.origin[0] - (way.origin[1] - way.origin[0]) if len(way.origin) > 1 else way.origin[0]
    stepper.start_moving(before)
