# SPDX-License-Identifier: Apache-2.0
"""Time the reference and XPBD on a swinging head of hair beside the network: the paper's simulator row, at 3,000 strands.

    python benchmarks/reference_speed.py [--strands N] [--frames T] [--device cpu|cuda] [--body V]

One warp thread per strand; on a CPU warp runs on one core. Error: distance to the reference at 16 and 32 substeps,
extrapolated to ever shorter steps, in percent of how far the hair moved; stretch: mean and worst, in percent. The network,
which always has one core of the CPU, moves as many strands of the shipped groom in the shipped shot, timed again beside each row:
the last columns say how many times as long a solver takes as the network alone, and as the network with its hair pushed out of
the body. On one core, all takes about two minutes at 3,000 strands.
"""

import argparse
import time
from collections.abc import Callable

import numpy as np
import plain_errors  # noqa: F401

from neuralocks_core.deformation.resolve import Resolver
from neuralocks_core.deformation.strand_session import StrandSession
from neuralocks_core.materials import Material
from neuralocks_core.reference import simulate, simulate_xpbd
from neuralocks_core.strands.strand_set import strands_on
from usd.baking.groom_models import GroomModels
from usd.review.demo import shipped_shot
from usd.shot.stage import read_shot


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
    """Seconds per frame, without the first and the settling before it."""
    ticks = []
    solver(rest, head, device=device, progress=lambda *_: ticks.append(clock(device)), **settings)
    return (ticks[-1] - ticks[0]) / (len(ticks) - 1)


class Network:
    """The shipped model on strands of the shipped groom, repeated up to a number of them, as the live view runs it."""

    def __init__(self, strands: int):
        item = read_shot(shipped_shot()).grooms[0]
        self.model = GroomModels(None, 1).of(item)
        self.character, self.clip = item.attachment.character, item.attachment.rig.clip
        real = strands_on(self.character, item.groom)
        some = real.subset(np.arange(strands) % len(real.rest))
        self.sampler, self.session = self.model.sampler(self.character, self.clip), StrandSession(self.model, some)
        self.session.anchor(self.sampler.held_bind(Material().log_ratios()))
        self.resolver = Resolver(self.character, some, self.clip)
        self.resolver.prepare()

    def cost(self, frames: int, device: str, keep_out: bool) -> float:
        """Seconds per frame of so many frames in the middle of the shot, after one more."""
        ticks, middle = [], len(self.clip.times) // 2
        shapes = self.clip.shape_at(self.clip.times)
        for row in (middle + np.arange(frames + 1)) % len(self.clip.times):
            joints = self.clip.joints[row]
            moved = self.session.displacement(self.sampler.vectors(self.clip.times[row : row + 1])[0])
            if keep_out:
                self.resolver.apply(moved, joints, shapes[row], self.model.by_chunk)
            ticks.append(clock(device))
        return (ticks[-1] - ticks[0]) / frames


def clock(device: str) -> float:
    """[s]; on a CPU, this process's CPU time, because others may be busy."""
    return time.process_time() if device == "cpu" else time.perf_counter()


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
    print(
        f"{'solver':20} {'ms/frame':>9} {'strand-frames/s':>16} {'error %':>8} {'stretch %':>15} {'x network':>10} {'kept out':>9}"
    )
    network, beside = Network(args.strands), []
    for name, solver, settings in rows:
        solver(rest[:4], head[:3], device=args.device, **settings)  # compiles the kernels
        spent = frame_cost(solver, rest, head, args.device, settings | body)
        result = solver(rest[few], head, device=args.device, **settings, **body).points
        error = np.linalg.norm(result - truth, axis=-1).mean() / moved
        stretch = np.abs(np.linalg.norm(np.diff(result.astype(float), axis=2), axis=-1) / lengths[few] - 1)
        beside.append([network.cost(len(head), args.device, keep_out) for keep_out in (False, True)])
        worst = f"{100 * stretch.mean():.2f} / {100 * stretch.max():.1f}"
        speed = f"{1e3 * spent:9.1f} {args.strands / spent:16.0f}"
        alone, kept_out = spent / np.array(beside[-1])
        print(f"{name:20} {speed} {100 * error:8.1f} {worst:>15} {alone:10.1f} {kept_out:9.1f}")
    for name, spent in zip(("network", "network, kept out"), np.median(beside, axis=0)):
        print(f"{name:20} {1e3 * spent:9.1f} {args.strands / spent:16.0f}")


if __name__ == "__main__":
    main()
