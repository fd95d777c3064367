# SPDX-License-Identifier: Apache-2.0
"""Strand models of random weights, for tests of what runs them."""

from pathlib import Path

import pytest

from neuralocks_core import model
from neuralocks_core.boundary_spec import BoundarySpec


def write_random_model(
    path: Path, gain: float, spec: BoundarySpec | None = None, *, anchored: bool = True, output: str = "direction"
) -> Path:
    """Write a model whose last layer is `gain` times that of an untrained one: 4 moves hair by centimetres, 0 not at all.

    `spec`, `anchored` and `output` are as in its file; those of the models shipped where left out.

    Skips the test where torch is not installed.
    """
    torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")
    from neuralocks_core.training.autoencoder import StrandAutoencoder
    from neuralocks_core.training.export import strand_graphs
    from neuralocks_core.training.networks import StrandNet

    torch.manual_seed(0)
    spec = spec or BoundarySpec()
    net, encoder = StrandNet(spec.size), StrandAutoencoder()
    with torch.no_grad():
        net.out.weight.mul_(gain)
        net.out.bias.mul_(gain)
    meta = {"kind": "strands", "boundary": spec.to_json(), "anchored": anchored, "output": output}
    return model.write(path, meta, strand_graphs(encoder, net, output))


def offsets_of(net, strands, frames):
    """What a network answers, (B, S, 24, 3), to strands (S, 70) or (B, S, 70) in frames (B, F)."""
    return net.tail(net.strand_part(strands), net.frame_part(frames)[:, None]).unflatten(-1, (24, 3))
