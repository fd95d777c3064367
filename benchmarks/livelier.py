# SPDX-License-Identifier: Apache-2.0
"""A strand model that feels how the head is accelerated, and wind, by so many times: a network that is not sure outputs the mean
of what is possible, which moves less than hair does.

    python benchmarks/livelier.py MODEL TIMES [--damping TIMES] -o OUT

Held poses stay as they are. With `--damping`, the logarithm of a damping relative to the default counts so many times, too, for a
model in which that slider has too small an effect; at the default, nothing changes by that. The card says so, without the
measurements of MODEL.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import plain_errors  # noqa: F401
import torch

from neuralocks_core.materials import RANGES


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("times", type=float)
    parser.add_argument("--damping", type=float, default=1.0, metavar="TIMES")
    parser.add_argument("-o", "--out", type=Path, required=True)
    print(livelier(**vars(parser.parse_args())))


def livelier(model: Path, times: float, out: Path, damping: float = 1.0) -> Path:
    """Write the model with `times` the weight of effective gravity's changes in its history, and `damping` that of damping."""
    from neuralocks_core.boundary.spec import BoundarySpec
    from neuralocks_core.models import model_file
    from neuralocks_core.training.export import strand_graphs
    from neuralocks_core.training.networks import StrandNet
    from neuralocks_core.training.warm_start import Beginning

    meta = model_file.read(model, "strands").meta
    spec, training = BoundarySpec.from_json(meta["boundary"]), meta["training"]
    net = StrandNet(spec.size, **{name: training["options"][name] for name in ("motion", "strand_map")})
    beginning = Beginning(model)
    beginning.fill(net)
    history = spec.slices["history"]
    place = spec.slices["material"].start + list(RANGES).index("damping")
    # A layer sees the default, a logarithm of 0, as so much below 0.
    normal = float(net.frame_mean[place] * net.frame_scale[place])
    with torch.no_grad():
        for layer in (net.frame, *list(net.encoder or ())[:1]):
            layer.weight[:, history].unflatten(1, (-1, spec.per_bin))[..., :3] *= times
            layer.bias.add_((damping - 1) * normal * layer.weight[:, place])
            layer.weight[:, place] *= damping
    told = f"acceleration of the head, times {times:g}" + (f"; damping, times {damping:g}" if damping != 1 else "")
    graphs = strand_graphs(beginning.coder(), net, meta["output"])
    return model_file.write(out, {**meta, "training": {**training, "livelier": told}, "report": {}}, graphs)


if __name__ == "__main__":
    main()
