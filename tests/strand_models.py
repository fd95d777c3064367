# SPDX-License-Identifier: Apache-2.0
"""Strand models of random weights, for tests of what runs them."""

import zipfile
from pathlib import Path

import pytest

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.models import model_file
from neuralocks_core.models.network_sizes import PLAIN_STRAND


def write_random_model(
    path: Path, gain: float, spec: BoundarySpec | None = None, *, anchored: bool = True, output: str = "direction"
) -> Path:
    """Write a model whose last layer is `gain` times that of an untrained one: 4 moves hair by centimetres, 0 not at all.

    `spec`, `anchored` and `output` are as in its file; if left out, those of the shipped models.

    Skips the test if torch is not installed.
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
    return model_file.write(path, meta, strand_graphs(encoder, net, output))


def without_rest_points(graphs: dict[str, bytes]) -> dict[str, bytes]:
    """The graphs of a model, whose strand part is linear, as if it read no rest points of a strand."""
    import onnx

    strand = onnx.load_model_from_string(graphs["strand.onnx"])
    weight = next(array for array in strand.graph.initializer if array.name == "strand_part.weight")
    weight.CopyFrom(onnx.numpy_helper.from_array(onnx.numpy_helper.to_array(weight)[:PLAIN_STRAND], weight.name))
    strand.graph.input[0].type.tensor_type.shape.dim[1].dim_value = PLAIN_STRAND
    return graphs | {"strand.onnx": strand.SerializeToString()}


def offsets_of(net, strands, frames):
    """What a network answers, (B, S, 24, 3), to strands (S, 142) or (B, S, 142) in frames (B, F)."""
    return net.tail(net.strand_part(strands), net.frame_part(frames)[:, None]).unflatten(-1, (24, 3))


def rewritten(path: Path, target: Path, **changes) -> Path:
    """A copy of a model file with entries replaced; None leaves one out."""
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            data = changes.get(name.replace(".", "_"), old.read(name))
            if data is not None:
                new.writestr(name, data)
    return target
