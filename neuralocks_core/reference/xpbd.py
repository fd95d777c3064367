# SPDX-License-Identifier: Apache-2.0
"""Extended position based dynamics: the simulator that games use, as the baseline of speed and accuracy."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.reference.device import start_warp
from neuralocks_core.reference.headway import headway
from neuralocks_core.reference.rest import GRAVITY, rest_rods
from neuralocks_core.reference.rods import Progress, Rollout, check_body, check_material

REACH = 0.1
"""[m] how far a vertex looks for the body."""


def simulate_xpbd(
    rest: np.ndarray,
    head: np.ndarray,
    body: Sequence[np.ndarray] | np.ndarray | None = None,
    triangles: np.ndarray | None = None,
    material: Any = None,
    *,
    dt: float = 1 / 30,
    substeps: int = 20,
    rest_support: bool = True,
    bind_body: np.ndarray | None = None,
    margin: float = 0.004,
    gravity: float = GRAVITY,
    device: str = "cpu",
    progress: Progress | None = None,
) -> Rollout:
    """Simulate strands by XPBD on the energies of `rods.simulate`, with one iteration in each of many substeps.

    It starts from the rest shape (there is no equilibrium solve) and has no ties between neighbours. Edges stretch by
    what one pass leaves; stiffness holds as far as the substeps carry it.

    Args:
        rest, head, body, triangles, material, dt, rest_support, bind_body, margin, gravity, device, progress: as in
            `rods.simulate`.
        substeps: in a frame.

    Returns:
        As `rods.simulate`; residual is NaN (nothing is solved for), iterations are the substeps.

    Raises:
        NeuralocksError: as `rods.simulate`.
    """
    if not (np.isfinite(dt) and dt > 0) or substeps < 1:
        raise NeuralocksError(f"dt {dt}, substeps {substeps}: must be positive")
    rods = rest_rods(rest, rest_support=rest_support)
    strands, vertices = rods.mass.shape
    way, frames = headway(head, substeps), len(head)
    material = check_material(material, strands)
    wp = start_warp(device)
    from neuralocks_core.reference import xpbd_kernels as kernels

    def vectors(values):
        return wp.array(np.ascontiguousarray(np.swapaxes(values, 0, 1), np.float32), dtype=wp.vec3, device=device)

    def reals(values):
        return wp.array(np.ascontiguousarray(values.T, np.float32), dtype=wp.float32, device=device)

    def numbers(values):
        return wp.array(values.astype(np.float32), dtype=wp.float32, device=device)

    def run(kernel, dim, *inputs):
        if strands:
            wp.launch(kernel, dim=dim, inputs=list(inputs), device=device)

    def carry(a, b):
        """The head's motion from substep a to substep b."""
        turn = wp.quat(*way.turn[b]) * wp.quat_inverse(wp.quat(*way.turn[a]))
        return turn, wp.vec3(*way.origin[b]) - wp.quat_rotate(turn, wp.vec3(*way.origin[a]))

    free = (np.arange(vertices) > 1)[None]
    shape = (vertices, strands)
    first = head[0, :3, :3].astype(float)
    length, inverse_mass, curl = reals(rods.length), reals(free / rods.mass), vectors(rods.curl)
    stiffness = reals(np.maximum(4 * material["bend"][:, None] / rods.mass, 1e-9))
    home, push = vectors(rods.points), vectors(rods.support / rods.mass[..., None] * (gravity / GRAVITY))
    weight, damping = numbers(material["weight"]), numbers(material["damping"])
    x = vectors(rods.points @ first.T + way.origin[0])
    old = wp.zeros(shape, dtype=wp.vec3, device=device)
    step = dt / substeps
    drift = (way.origin[1] - way.origin[0]) / step if frames > 1 else np.zeros(3)
    velocity = vectors(np.broadcast_to(drift, rods.points.shape))
    plane = wp.array(np.full((*shape, 4), [0, 0, 0, -1e3], np.float32), dtype=wp.vec4, device=device)
    limit = reals(np.full((strands, vertices), margin))
    if body is not None:
        start, faces = check_body(body, triangles, frames)
        bind = (start - way.origin[0]) @ first if bind_body is None else np.asarray(bind_body)
        surface = wp.array(bind.astype(np.float32), dtype=wp.vec3, device=device)
        mesh = wp.Mesh(points=surface, indices=wp.array(faces.astype(np.int32).ravel(), dtype=wp.int32, device=device))
        still = (wp.quat_identity(), wp.vec3(), wp.quat_identity(), wp.vec3())
        run(kernels.look, shape, mesh.id, REACH, *still, home, plane)
        near = np.swapaxes(plane.numpy(), 0, 1)
        limit = reals(np.minimum(margin, (near[..., :3] * rods.points).sum(-1) - near[..., 3]))
    points = np.zeros((frames, strands, vertices, 3), np.float32)
    planes = np.full((frames, strands, vertices, 4), [0, 0, 0, -1e3], np.float32)
    for t in range(frames):
        a, b = max(t - 1, 0) * substeps, t * substeps
        if body is not None:
            surface.assign(np.asarray(body[t], np.float32))
            mesh.refit()
            pose = wp.quat(*way.turn[b]), wp.vec3(*way.origin[b])
            run(kernels.look, shape, mesh.id, REACH, *pose, *carry(a, b), x, plane)
        if t:
            turns = wp.array(way.turn[a : b + 1].astype(np.float32), dtype=wp.quat, device=device)
            origins = wp.array(way.origin[a : b + 1].astype(np.float32), dtype=wp.vec3, device=device)
            run(
                kernels.frame, strands, length, inverse_mass, stiffness, curl, home, push, weight, damping, turns,
                origins, wp.vec3(0.0, -gravity, 0.0), step, plane, limit, x, old, velocity,
            )  # fmt: skip
        posed = np.swapaxes(x.numpy(), 0, 1) - way.origin[b]
        points[t] = posed @ np.asarray(head[t], float)[:3, :3]
        planes[t] = np.swapaxes(plane.numpy(), 0, 1)
        if progress:
            progress(t + 1, frames, "simulating")
    return Rollout(points, planes, np.full(frames, np.nan), np.full(frames, float(substeps)))
