# SPDX-License-Identifier: Apache-2.0
"""Training the tiny quasi-static network of a rig without any data: random neck poses, energy as loss (paper
section 4.4).
"""

import time
from collections.abc import Callable
from dataclasses import asdict

import numpy as np
import torch

from neuralocks_core.rig.network import RigModel, input_limits, rig_spec
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.training.rig_energy import RigEnergy, RigMaterial, bounded_turns
from neuralocks_core.training.rig_poses import PosePool
from neuralocks_core.training.rig_report import static_report

_COLLIDING = 160
"""Hair vertices that collide in one step, drawn anew: finding the nearest body is nearly all of a step's time."""
Progress = Callable[[int, int, str], None]


def train_static(
    rig: HairRig,
    material: RigMaterial = RigMaterial(),
    *,
    seconds: float = 75.0,
    steps: int | None = None,
    hidden: int = 16,
    seed: int = 0,
    max_angle: float = 2.4,
    poses: int = 512,
    batch: int = 32,
    report_poses: int = 1000,
    progress: Progress | None = None,
) -> RigModel:
    """Train the quasi-static network of one rig.

    Args:
        rig: chains, hair vertices and body.
        material: constants of the energy.
        seconds: how long to train; `steps`, if given, takes its place and makes the result repeatable.
        hidden: width of both layers (the paper's 16).
        seed: decides poses and first weights.
        max_angle: largest turn of one joint [rad].
        poses: posed bodies to draw from.
        batch: poses a step.
        report_poses: held-out poses of the report; 0 leaves it out.
        progress: called with (done, total, message); may raise to stop.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    spec = rig_spec()
    say = progress or (lambda done, total, message: None)
    say(0, 1, "posing bodies")
    pool = PosePool(rig, poses, rng)
    energy = RigEnergy(rig, material)
    prepare_rest(energy, rig)
    net = TinyNet(15, hidden, len(rig.chains), pool, spec, max_angle)
    optimiser = torch.optim.Adam(net.parameters(), lr=4e-3)
    began, done, mean = time.monotonic(), 0, 0.0
    share = 0.0
    while share < 1:
        for group in optimiser.param_groups:
            group["lr"] = 4e-3 * min(1.0, (done + 1) / 50) * (0.5 + 0.5 * np.cos(np.pi * min(share, 1.0))) + 2e-5
        chosen = rng.integers(0, poses, batch)
        gravity = pool.gravity(chosen)
        quaternions = net(torch.as_tensor(pool.features(spec, chosen, gravity)))
        some = torch.as_tensor(rng.choice(len(energy.chosen), min(_COLLIDING, len(energy.chosen)), replace=False))
        loss = total_energy(energy, pool, chosen, quaternions, gravity, some).mean()
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        done += 1
        mean += 0.02 * (float(loss.detach()) - mean)
        share = done / steps if steps else (time.monotonic() - began) / seconds
        if done % 25 == 0:
            say(min(int(1000 * share), 1000), 1000, f"energy {mean:.3f} m^2/s^2")
    model = RigModel(
        rig.chains,
        spec,
        net.plain_layers(rig.chains.axes),
        input_limits(spec),
        max_angle,
        training={
            "method": "quasi-static, self-supervised",
            "steps": done,
            "seconds": round(time.monotonic() - began, 1),
            "seed": seed,
            "poses": poses,
            "batch": batch,
            "hidden": hidden,
            "material": asdict(material),
        },
    )
    report = static_report(model, rig, material, report_poses, seed + 1, say) if report_poses else {}
    object.__setattr__(model, "report", report)
    return model


def total_energy(energy: RigEnergy, pool: PosePool, poses, quaternions, gravity, some=None) -> torch.Tensor:
    """Energy (B,) of turns (B, N, 4) in poses of the pool with gravity directions (B, 3); planes are those of the
    state itself.
    """
    rotation, position, ends = energy.pose(quaternions)
    down = torch.as_tensor(gravity, dtype=ends.dtype) * 9.81
    result = energy.elastic(quaternions, down, ends)
    if pool.points is not None:
        points = energy.skin(rotation, position, some)
        normals, offsets = pool.planes(poses, points.detach().numpy())
        result = result + energy.collision(points, torch.as_tensor(normals), torch.as_tensor(offsets), some)
    return result


def prepare_rest(energy: RigEnergy, rig: HairRig) -> None:
    """Cap the margins by each vertex's own distance in the bind pose of the body as modelled."""
    pool = PosePool(rig, 1, np.random.default_rng(0), most_points=100_000)
    if pool.points is None:
        return
    pool.normals, bind = pool.normals, energy.points.numpy()[None]
    normals, offsets = pool.planes(np.zeros(1, int), bind)
    energy.set_rest_distances(np.einsum("vi,vi->v", normals[0], bind[0]) - offsets[0])


class TinyNet(torch.nn.Module):
    """Two hidden layers; gives turns (B, N, 4) in canonical axes, none for the held bind pose."""

    def __init__(self, inputs: int, hidden: int, joints: int, pool: PosePool, spec, max_angle: float):
        super().__init__()
        self.joints, self.max_angle = joints, max_angle
        sample = np.arange(min(pool.count, 512))
        features = pool.features(spec, sample, pool.gravity(sample))
        self.register_buffer("mean", torch.as_tensor(features.mean(0)))
        self.register_buffer("scale", torch.as_tensor(1 / np.maximum(features.std(0), 0.05)))
        still = np.zeros(inputs, np.float32)
        still[[0, 4, 6, 10, 13]] = 1, 1, 1, 1, -1
        self.register_buffer("bind", torch.as_tensor(still)[None])
        self.layers = torch.nn.ModuleList(
            [torch.nn.Linear(inputs, hidden), torch.nn.Linear(hidden, hidden), torch.nn.Linear(hidden, 3 * joints)]
        )
        torch.nn.init.normal_(self.layers[2].weight, std=0.02)

    def raw(self, features: torch.Tensor) -> torch.Tensor:
        """Unbounded outputs (B, 3 N) of features (B, F)."""
        value = (features - self.mean) * self.scale
        value = torch.relu(self.layers[0](value))
        return self.layers[2](torch.relu(self.layers[1](value)))

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        raw = self.raw(features) - self.raw(self.bind)
        return bounded_turns(raw.reshape(len(features), self.joints, 3), self.max_angle)

    def plain_layers(self, axes: np.ndarray) -> tuple:
        """Weights and biases with the normalisation, the bind pose and the joints' axes (N, 3, 3) folded in;
        summed in float64.
        """
        w = [layer.weight.detach().double().numpy() for layer in self.layers]
        b = [layer.bias.detach().double().numpy() for layer in self.layers]
        b[0] = b[0] - w[0] @ (self.mean * self.scale).double().numpy()
        w[0] = w[0] * self.scale.double().numpy()
        w, b = [x.astype(np.float32) for x in w], [x.astype(np.float32) for x in b]
        hidden = np.maximum(w[0] @ self.bind[0].numpy() + b[0], 0)
        hidden = np.maximum(w[1] @ hidden + b[1], 0).astype(float)
        turned = np.einsum("nji,njk->nik", axes, w[2].astype(float).reshape(-1, 3, w[2].shape[1]))
        w[2] = turned.reshape(w[2].shape).astype(np.float32)
        b[2] = -(w[2].astype(float) @ hidden)
        return tuple(zip(w, b))
