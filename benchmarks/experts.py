# SPDX-License-Identifier: Apache-2.0
"""Several second and output layers, of which each strand uses one: one row of a table, from random weights.

    python benchmarks/experts.py WORK --motion BVH ... [--experts 4] [--hidden 384] [--steps 1000] [--rollouts 740]

WORK has `rollouts` and `held_out` of a training of the library with seed 8 and two variations. Strands are sorted by their rest
points and root normals (k-means), so that a bake would choose once per groom.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from scipy.cluster.vq import kmeans2
from torch import nn

from neuralocks_core import model
from neuralocks_core.network_sizes import PLAIN_STRAND, SHAPE, STRAND, K
from neuralocks_core.training import networks
from neuralocks_core.training.beginning import Beginning
from neuralocks_core.training.farm import load
from neuralocks_core.training.gauge import measure
from neuralocks_core.training.methods import samples
from neuralocks_core.training.networks import StrandNet
from neuralocks_core.training.regression import RolloutBank, regress
from neuralocks_core.training.regression_options import RegressionOptions
from usd.models.training_scene import training_scene


class Experts(StrandNet):
    """As StrandNet, with `count` changes of both layers that run per strand and frame."""

    def __init__(self, frame_size: int, count: int, **kind):
        super().__init__(frame_size, **kind)
        hidden = self.middle.in_features
        self.middles = nn.ModuleList([nn.Linear(hidden, hidden) for _ in range(count)])
        self.outs = nn.ModuleList([nn.Linear(hidden, SHAPE) for _ in range(count)])
        for layer in (*self.middles, *self.outs):
            nn.init.zeros_(layer.weight)
            nn.init.zeros_(layer.bias)
        self.register_buffer("centres", torch.zeros(count, SHAPE + 3))

    def strand_part(self, strands):
        """The strand's part of the first layer, and which expert it uses, as a last number."""
        place = sorted_by(strands)
        nearest = torch.cdist(place.reshape(-1, place.shape[-1]), self.centres).argmin(-1)
        return torch.cat([super().strand_part(strands), nearest.reshape(*place.shape[:-1], 1).float()], -1)

    def tail(self, strand_part, frame_part):
        """See StrandNet."""
        which, strand_part = strand_part[..., -1], strand_part[..., :-1]
        hidden = strand_part.shape[-1]
        added, one, two, middle, out = frame_part.split([hidden, hidden, hidden, *networks.RANKS], dim=-1)
        first = torch.relu(strand_part + added) * one
        which = which.expand(first.shape[:-1]).reshape(-1)
        rows = [torch.nonzero(which == k)[:, 0] for k in range(len(self.middles))]
        second = _each(first, self.middle, self.middles, rows) + self.middle_change(first, middle)
        second = torch.relu(second) * two
        return _each(second, self.out, self.outs, rows) + self.out_change(second, out)


def _each(values, shared: nn.Linear, own, rows):
    flat = values.reshape(-1, values.shape[-1])
    parts = [
        nn.functional.linear(flat[chosen], shared.weight + layer.weight, shared.bias + layer.bias)
        for chosen, layer in zip(rows, own, strict=True)
    ]
    result = flat.new_zeros(len(flat), shared.out_features).index_copy(0, torch.cat(rows), torch.cat(parts))
    return result.reshape(*values.shape[:-1], -1)


def sorted_by(strands):
    """What strands are sorted by (..., 75): rest points from the root, and the root normal."""
    points, normal = strands[..., PLAIN_STRAND:STRAND], strands[..., PLAIN_STRAND - 4 : PLAIN_STRAND - 1]
    return torch.cat([points / K**0.5, 0.1 * normal], -1)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("work", type=Path)
    parser.add_argument("--motion", nargs="+", default=[])
    parser.add_argument("--experts", type=int, default=1)
    parser.add_argument("--hidden", type=int, default=256)
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--rollouts", type=int, default=740)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    networks.HIDDEN = arguments.hidden
    scene = training_scene("examples/shot/body.usdc", ["library"], arguments.motion, seed=8, variations=2)
    coder, banks = Beginning(model.shipped("strands")).coder(), {}
    for name, which in (("rollouts", scene), ("held_out", replace(scene, held_out=True))):
        bank = banks[name] = RolloutBank(which, coder.codes_of)
        bank.rollouts = [load(path) for path in sorted((arguments.work / name).glob("*.npz"))[: arguments.rollouts]]
    options = RegressionOptions(rate=4e-3, steps=arguments.steps, mirror=0.5, bending=0.5)
    torch.manual_seed(0)
    kind = {"motion": options.motion, "strand_map": options.strand_map}
    if arguments.experts == 1:
        net = StrandNet(scene.spec.size, **kind)
    else:
        net = Experts(scene.spec.size, arguments.experts, **kind)
        strands = np.concatenate([inputs[::7] for inputs in banks["rollouts"].inputs])
        places = sorted_by(torch.from_numpy(strands)).double().numpy()
        net.centres.copy_(torch.from_numpy(kmeans2(places, arguments.experts, seed=0, minit="++")[0]).float())
    history = scene.spec.slices["history"]
    net.set_normalisation(*map(torch.from_numpy, samples(banks["rollouts"])), history)
    began = time.process_time()
    *_, state = regress(banks["rollouts"], net, options, options.optimisers(net), list)
    print(f"{state.step} steps, {time.process_time() - began:.0f} s of CPU")
    for name, bank in banks.items():
        bank.rollouts = bank.rollouts[:64]
        print(name, measure(net, bank, options.output, history, options.anchored).to_json())


if __name__ == "__main__":
    main()
