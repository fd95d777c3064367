# SPDX-License-Identifier: Apache-2.0
"""Time the reference and XPBD on a swinging head of hair: the paper's simulator row, at 3,000 strands.

    python benchmarks/reference_speed.py [--strands N] [--frames T] [--device cpu|cuda] [--body V]

One warp thread per strand; on a CPU warp runs on one core. Error: distance to the reference at 16 and 32 substeps,
extrapolated to ever shorter steps, in percent of how far the hair moved; stretch: mean and worst, in percent. On one
core, all takes about two minutes at 3,000 strands.
"""

import argparse
import time
from collections.abc import Callable

import numpy as np
import plain_errors  # noqa: F401

from neuralocks_core.reference import simulate, simulate_xpbd


def hair(strands: int) -> np.ndarray:
    """(S, 24, 3) strands of 20 to 30 cm on a head of 10 cm."""
    rng = np.random.default_rng(0)
    out = rng.normal(size=(strands, 3))
    out[:, 1] = np.abs(out[:, 1])
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    bow = np.clip(np.linspace(0, 6, 23), 0, 1)[None, :, None] * np.pi / 2
    side = out * [1, 0, 1] / np.linalg.norm(out * [1, 0, 1], axis=1, keepdims=True)
    away = np.clip(1 - np.linspace(0, 2, 23), 0, 1)[None, :, None] * side[:, None]
    edges = out[:, None] * np.cos(bow) + (away + [0, -0.5, 0]) * np.sin(bow)
    edges *= rng.uniform(0.2, 0.3, (strands, 1, 1)) / 23 / np.linalg.norm(edges, axis=-1, keepdims=True)
    return 0.1 * out[:, None] + np.concatenate([np.zeros((strands, 1, 3)), np.cumsum(edges, 1)], 1)


def swing(frames: int) -> np.ndarray:
    """(T, 4, 4): the head shakes and sways."""
    t = np.arange(frames) / 30
    angle = 0.6 * np.sin(2 * np.pi * t)
    head = np.tile(np.eye(4), (frames, 1, 1))
    head[:, 0, 0] = head[:, 2, 2] = np.cos(angle)
    head[:, 0, 2], head[:, 2, 0] = np.sin(angle), -np.sin(angle)
    head[:, 0, 3] = 0.1 * np.sin(2 * np.pi * 0.7 * t)
    return head


def ball(vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """A head of 9.8 cm radius with about `vertices` vertices."""
    import trimesh

    mesh = trimesh.creation.icosphere(max(0, round(np.log(vertices / 10) / np.log(4))), radius=0.098)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def frame_cost(solver: Callable, rest: np.ndarray, head: np.ndarray, device: str, settings: dict) -> float:
    """Seconds per frame, without the first and the settling before it; on a CPU, this process's CPU time."""
    clock = time.process_time if device == "cpu" else time.perf_counter
    ticks = []
    solver(rest, head, device=device, progress=lambda *_: ticks.append(clock()), **settings)
    return (ticks[-1] - ticks[0]) / (len(ticks) - 1)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--strands", type=int, default=3000)
    options.add_argument("--frames", type=int, default=30)
    options.add_argument("--device", default="cpu")
    options.add_argument("--body", type=int, default=2562, help="vertices of the body; 0 for none")
    args = options.parse_args()
    rest, head = hair(args.strands), swing(max(2, args.frames))
    body = {}
    if args.body:
        points, faces = ball(args.body)
        world = np.einsum("tij,vj->tvi", head[:, :3, :3], points) + head[:, None, :3, 3]
        body = {"body": world.astype(np.float32), "triangles": faces, "bind_body": points}
    few = slice(0, min(200, args.strands))
    coarse, fine = (
        simulate(rest[few], head, substeps=n, iterations=40, tolerance=1e-5, device=args.device, **body).points
        for n in (16, 32)
    )
    truth = fine + (fine - coarse) / 3  # the error is of second order in the step
    moved = np.linalg.norm(truth - rest[few], axis=-1).mean()
    lengths = np.linalg.norm(np.diff(rest, axis=1), axis=-1)
    rows = [("implicit, 1 step", simulate, {"substeps": 1}), ("implicit, 4 steps", simulate, {"substeps": 4})]
    rows += [(f"XPBD, {n} substeps", simulate_xpbd, {"substeps": n}) for n in (10, 20, 50)]
    print(f"{args.strands} strands of 24 vertices, {args.frames} frames, body {args.body}, {args.device}")
    print(f"{'solver':20} {'ms/frame':>9} {'strand-frames/s':>16} {'error %':>8} {'stretch %':>15} {'ratio':>6}")
    base = None
    for name, solver, settings in rows:
        solver(rest[:4], head[:3], device=args.device, **settings)  # compiles the kernels
        spent = frame_cost(solver, rest, head, args.device, settings | body)
        result = solver(rest[few], head, device=args.device, **settings, **body).points
        error = np.linalg.norm(result - truth, axis=-1).mean() / moved
        stretch = np.abs(np.linalg.norm(np.diff(result.astype(float), axis=2), axis=-1) / lengths[few] - 1)
        base = base or spent
        worst = f"{100 * stretch.mean():.2f} / {100 * stretch.max():.1f}"
        speed = f"{1e3 * spent:9.1f} {args.strands / spent:16.0f}"
        print(f"{name:20} {speed} {100 * error:8.1f} {worst:>15} {spent / base:6.1f}")


if __name__ == "__main__":
    main()
