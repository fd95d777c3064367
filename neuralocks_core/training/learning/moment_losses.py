# SPDX-License-Identifier: Apache-2.0
"""What self-supervised training minimises: the potentials at random moments (paper section 3.4, equation 1)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.materials import Material
from neuralocks_core.physics.energies import Stiffness, Surroundings, energies
from neuralocks_core.physics.inertia import inertia
from neuralocks_core.physics.rods import Rods
from neuralocks_core.physics.self_collision import self_collision
from neuralocks_core.training.data.moments import Hair, Moment, nearest_planes
from neuralocks_core.training.learning.moment_options import SelfSupervisedOptions
from neuralocks_core.training.networks import StrandNet, deform


def moment_losses(
    net: StrandNet,
    moments: list[Moment],
    hair: list[Hair],
    inputs: list[np.ndarray],
    spec: BoundarySpec,
    options: SelfSupervisedOptions,
    rng: np.random.Generator,
    dynamics: float = 1.0,
) -> dict[str, Tensor]:
    """Mean energy per unit mass of every potential [m^2/s^2].

    Args:
        net: the network.
        moments: B moments.
        hair: the hair of each. Small grooms have fewer strands: only moments with equally many are stacked.
        inputs: the network's inputs from each groom's strands, one (S, 142) per groom.
        spec: of the boundary vectors.
        options: weights of the potentials, ranges of the materials, the device.
        rng: source of random materials.
        dynamics: factor on inertia and damping; 0 is the quasi-static problem.

    Returns:
        By name; `inertia_past` is the term whose past is not detached, with its weight.
    """
    counts = np.array([len(h.strands) for h in hair])
    total: dict[str, Tensor] = {}
    for count in np.unique(counts):
        alike = np.flatnonzero(counts == count)
        chosen = ([moments[i] for i in alike], [hair[i] for i in alike])
        for name, mean in _stacked_losses(net, *chosen, inputs, spec, options, rng, dynamics).items():
            total[name] = total.get(name, 0.0) + len(alike) / len(hair) * mean
    return total


def _stacked_losses(net, moments, hair, inputs, spec, options, rng, dynamics) -> dict[str, Tensor]:
    """Like `moment_losses`, for hair with the same number of strands each."""
    device = options.device
    rods = _stacked(hair, device)
    materials = [_material(options, rng) for _ in moments]
    frames = np.stack([np.concatenate([m.vectors, h.bind[None]]) for m, h in zip(moments, hair)])
    frames[:, :, spec.slices["material"]] = np.stack([m.log_ratios() for m in materials])[:, None]
    strands = net.strand_part(_tensor(np.stack([inputs[h.groom][h.strands] for h in hair]), device))
    parts = net.frame_part(_tensor(frames, device))
    anchor = net.tail(strands, parts[:, 3, None]).unflatten(-1, (-1, 3)) if options.supported else None

    def predict(frame: int) -> Tensor:
        offsets = net.tail(strands, parts[:, frame, None]).unflatten(-1, (-1, 3))
        return rods.rest + deform(offsets, rods.rest, anchor, options.output)

    x = predict(2)
    around = _around(x, moments, hair, options)
    dynamic = dynamics > 0 and not options.static
    if dynamic:
        with torch.set_grad_enabled(torch.is_grad_enabled() and options.undetached > 0):
            past = [predict(1), predict(0)]
            back = _tensor(np.stack([m.back for m in moments]), device)
            before, before2 = (_carried(back[:, i], past[i]) for i in range(2))
        around = replace(around, before=before, before2=before2, moved_before=past[0], dt=spec.dt)
    terms = energies(
        x,
        rods,
        around,
        _stiffness(materials, hair, options, dynamics),
        form=options.form,
        paper_adhesion=options.paper_adhesion,
    )
    if dynamic and options.undetached > 0:
        whole = inertia(x, before, before2, rods, spec.dt, detach=False)
        terms["inertia_past"] = options.undetached * dynamics * whole
    if options.volume > 0:
        few = max(1, len(moments) // 4)
        density = torch.stack([h.rest_density for h in hair[:few]]).to(device)
        terms["self_collision"] = torch.cat(
            [self_collision(x[i : i + 1], _one(rods, i), density[i : i + 1], options.volume) for i in range(few)]
        )
    length = rods.length.sum(-1)
    return {name: (energy / length[: len(energy)]).mean() for name, energy in terms.items()}


def _around(x: Tensor, moments: list[Moment], hair: list[Hair], options: SelfSupervisedOptions) -> Surroundings:
    """What acts at the moments, with the body element nearest to the current points."""
    device = x.device
    planes = distance = None
    if all(m.surface is not None for m in moments):
        points = x.detach().cpu().double().numpy()
        found = [nearest_planes(m.surface, m.normals, p) for m, p in zip(moments, points)]
        planes, distance = (_tensor(np.stack([f[i] for f in found]), device) for i in range(2))
    return Surroundings(
        gravity=_tensor(np.stack([m.gravity for m in moments]), device),
        planes=planes,
        margin=torch.stack([h.margin for h in hair]).to(device),
        distance=distance if any(options.style) else None,
        neighbours=torch.stack([h.neighbours for h in hair]).to(device),
    )


def _stiffness(materials, hair: list[Hair], options: SelfSupervisedOptions, dynamics: float) -> Stiffness:
    def column(values) -> Tensor:
        return _tensor(np.array(values, np.float32)[:, None, None], options.device)

    drag = [options.damping if not options.random_materials else m.damping for m in materials]
    return Stiffness(
        bend=column([m.bend for m in materials]),
        weight=column([m.weight for m in materials]),
        damping=column(drag),
        clumping=column([options.adhesion * m.clumping for m in materials]),
        style=column([options.style[min(h.groom, len(options.style) - 1)] for h in hair]),
        inertia=dynamics,
    )


def _material(options: SelfSupervisedOptions, rng: np.random.Generator) -> Material:
    """Of weight 1, which tells the network about the others (`at_weight_one`)."""
    return replace(Material.random(rng), weight=1.0) if options.random_materials else Material()


def _carried(transform: Tensor, points: Tensor) -> Tensor:
    """Points (B, S, K, 3) transformed by (B, 4, 4)."""
    return torch.einsum("bij,bskj->bski", transform[:, :3, :3], points) + transform[:, None, None, :3, 3]


def _stacked(hair: list[Hair], device: str) -> Rods:
    fields = vars(hair[0].rods)
    return Rods(**{name: torch.stack([getattr(h.rods, name) for h in hair]).to(device) for name in fields})


def _one(rods: Rods, i: int) -> Rods:
    return Rods(**{name: each[i : i + 1] for name, each in vars(rods).items()})


def _tensor(array: np.ndarray, device) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(array, np.float32)).to(device)
