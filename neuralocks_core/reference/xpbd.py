# SPDX-License-Identifier: Apache-2.0
"""Extended position based dynamics: the simulator that games use, as a baseline for speed and accuracy."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from neuralocks_core.materials import MARGIN, NO_PLANE
from neuralocks_core.motion import G
from neuralocks_core.progress import Progress
from neuralocks_core.reference.arguments import (
    check_body,
    check_material,
    check_pose,
    check_settings,
    check_start,
    check_wind,
)
from neuralocks_core.reference.head_motion import HeadMotion, frames_without, head_motion
from neuralocks_core.reference.rest import RestRods, rest_rods
from neuralocks_core.reference.solver import SimulatedHair
from neuralocks_core.reference.stepper import REACH
from neuralocks_core.warp_device import start_warp


def simulate_xpbd(
    rest: np.ndarray,
    head: np.ndarray,
    body: Sequence[np.ndarray] | np.ndarray | None = None,
    triangles: np.ndarray | None = None,
    material: Any = None,
    *,
    dt: float = 1 / 30,
    substeps: int = 20,
    ahead: int = 0,
    rest_support: bool = True,
    start: np.ndarray | None = None,
    bind_body: np.ndarray | None = None,
    margin: float = MARGIN,
    gravity: float = G,
    wind: np.ndarray | None = None,
    device: str = "cpu",
    progress: Progress | None = None,
) -> SimulatedHair:
    """Simulate strands by XPBD on the energies of `solver.simulate`, with one iteration in each of many substeps.

    There is no equilibrium solve before the first frame, and there are no ties between neighbours. Edges keep the stretch that one
    pass leaves; how stiff hair really is depends on the number of substeps.

    Args:
        rest, head, triangles, material, dt, ahead, rest_support, bind_body, margin, gravity, wind, device, progress: as in
            `solver.simulate`.
        body: as in `solver.simulate`, but in all substeps that lead to a frame it is where that frame has it, as seen from the
            head. Frames are read in order, the first twice.
        start: as in `solver.simulate`, but None is the rest shape.
        substeps: per frame; the wind is the same in all of them. Beyond a few hundred, errors grow again: single precision rounds
            away what gravity does in so short a step.

    Returns:
        As `solver.simulate`; residual is NaN (nothing is solved for), iterations are the substeps.

    Raises:
        NeuralocksError: as `solver.simulate`.
    """
    check_settings(dt, margin, gravity, substeps=substeps)
    rods, way = rest_rods(rest, rest_support=rest_support), head_motion(head, substeps)
    frames = frames_without(head, ahead)
    strands, vertices = rods.mass.shape
    hair = _Hair(rods, way, check_material(material, strands), margin, gravity, device)
    wind, start = check_wind(wind, frames), check_start(start, rods)
    step, first = dt / substeps, head[0, :3, :3].astype(float)
    drift = (way.origin[1] - way.origin[0]) / step if frames > 1 else np.zeros(3)
    hair.begin(rods.points if start is None else start, first, drift)
    if body is not None:
        here, faces = check_body(body, triangles, frames)
        if bind_body is None:
            bind_body = (here - way.origin[0]) @ first
        hair.attach_body(check_pose("bind_body", bind_body, len(here)), faces)
    points = np.zeros((frames, strands, vertices, 3), np.float32)
    for t in range(frames):
        a, b = max(t - 1, 0) * substeps, t * substeps
        if body is not None:
            hair.look(check_pose("body", body[t], len(here)) - way.origin[b], a, b)
        if t:
            hair.go(a, b, step, wind[t])
        hair.read(head[t], points[t])
        if progress:
            progress(t + 1, frames, "simulating")
    return SimulatedHair(points, None, np.full(frames, np.nan), np.full(frames, float(substeps)))


class _Hair:
    """Strands on a device, and the body around them. Arrays are (K, S), points relative to the head's position in world axes."""

    def __init__(self, rods: RestRods, way: HeadMotion, material: dict, margin: float, gravity: float, device: str):
        self.wp = wp = start_warp(device)
        from neuralocks_core.reference.kernels import xpbd as xpbd_kernels

        self.kernels, self.rods, self.way, self.margin, self.device = xpbd_kernels, rods, way, margin, device
        self.strands, vertices = rods.mass.shape
        self.shape = (vertices, self.strands)
        free = (np.arange(vertices) > 1)[None]
        self.length, self.inverse_mass = self._reals(rods.length), self._reals(free / rods.mass)
        self.curl, self.home = self._vectors(rods.curl), self._vectors(rods.points)
        self.push = self._vectors(rods.support / rods.mass[..., None] * (gravity / G))
        self.stiffness = self._reals(np.maximum(4 * material["bend"][:, None] / rods.mass, 1e-9))
        self.weight, self.damping = self._numbers(material["weight"]), self._numbers(material["damping"])
        self.gravity = wp.vec3(0.0, -gravity, 0.0)
        self.old, self.twist = (wp.zeros(self.shape, dtype=wp.vec3, device=device) for _ in range(2))
        self.waiting = wp.zeros(self.shape, dtype=wp.float32, device=device)
        far = np.full((*self.shape, 4), NO_PLANE, np.float32)
        self.plane = wp.array(far, dtype=wp.vec4, device=device)
        self.limit = self._reals(np.full((self.strands, vertices), margin))
        self.mesh = None

    def begin(self, points: np.ndarray, first: np.ndarray, drift: np.ndarray) -> None:
        """Start at canonical points (S, K, 3) in the first pose, rotation (3, 3), all moving with velocity `drift` (3,) [m/s]."""
        self.x = self._vectors(points @ first.T)
        self.velocity = self._vectors(np.broadcast_to(drift, points.shape))

    def attach_body(self, bind: np.ndarray, faces: np.ndarray) -> None:
        """Measure the strands' distances at rest from (V, 3) bind points, canonical."""
        wp = self.wp
        self.surface = wp.array(bind.astype(np.float32), dtype=wp.vec3, device=self.device)
        indices = wp.array(faces.astype(np.int32).ravel(), dtype=wp.int32, device=self.device)
        self.mesh = wp.Mesh(points=self.surface, indices=indices)
        still = wp.quat_identity(), wp.quat_identity()
        self._run(self.kernels.look, self.shape, self.mesh.id, REACH, *still, self.home, self.plane)
        near = np.swapaxes(self.plane.numpy(), 0, 1)
        self.limit = self._reals(np.minimum(self.margin, (near[..., :3] * self.rods.points).sum(-1) - near[..., 3]))

    def look(self, body: np.ndarray, a: int, b: int) -> None:
        """Move the body to points (V, 3) relative to the head, and find what is near as the head goes from substep a to b."""
        self.surface.assign(np.asarray(body, np.float32))
        self.mesh.refit()
        before, turn = (self.wp.quat(*self.way.turn[i]) for i in (a, b))
        carry = turn * self.wp.quat_inverse(before)
        self._run(self.kernels.look, self.shape, self.mesh.id, REACH, turn, carry, self.x, self.plane)

    def go(self, a: int, b: int, step: float, wind: np.ndarray) -> None:
        """Advance from substep a to b, each of `step` [s], in a wind (3,) [m/s^2]."""
        wp, wind = self.wp, self.wp.vec3(*(float(v) for v in wind))
        turns = wp.array(self.way.turn[a : b + 1].astype(np.float32), dtype=wp.quat, device=self.device)
        way = self.way.origin[a : b + 1]
        moves = wp.array(np.diff(way, axis=0, prepend=way[:1]).astype(np.float32), dtype=wp.vec3, device=self.device)
        self._run(
            self.kernels.frame, self.strands, self.length, self.inverse_mass, self.stiffness, self.curl, self.home,
            self.push, self.weight, self.damping, turns, moves, self.gravity, wind, step, self.plane, self.limit, self.x,
            self.old, self.velocity, self.twist, self.waiting,
        )  # fmt: skip

    def read(self, head: np.ndarray, points: np.ndarray) -> None:
        """Write (S, K, 3) canonical, for the current head (4, 4)."""
        points[:] = np.swapaxes(self.x.numpy(), 0, 1) @ np.asarray(head, float)[:3, :3]

    def _run(self, kernel: object, dim: int | tuple, *inputs) -> None:
        if self.strands:
            self.wp.launch(kernel, dim=dim, inputs=list(inputs), device=self.device)

    def _vectors(self, values: np.ndarray) -> object:
        turned = np.ascontiguousarray(np.swapaxes(values, 0, 1), np.float32)
        return self.wp.array(turned, dtype=self.wp.vec3, device=self.device)

    def _reals(self, values: np.ndarray) -> object:
        return self.wp.array(np.ascontiguousarray(values.T, np.float32), dtype=self.wp.float32, device=self.device)

    def _numbers(self, values: np.ndarray) -> object:
        return self.wp.array(values.astype(np.float32), dtype=self.wp.float32, device=self.device)
