# SPDX-License-Identifier: Apache-2.0
"""From trained torch modules to the four ONNX graphs of a model file."""

from __future__ import annotations

import numpy as np
import torch
from torch import nn

from neuralocks_core.models.model_file import REMEDIES
from neuralocks_core.models.network_sizes import SHAPE, K
from neuralocks_core.models.onnx_graph import OnnxGraph
from neuralocks_core.strands.strand_set import CLAMPED
from neuralocks_core.training.autoencoder import StrandAutoencoder
from neuralocks_core.training.networks import StrandNet, smoothing


def strand_graphs(autoencoder: StrandAutoencoder, net: StrandNet, output: str) -> dict[str, bytes]:
    """The graphs that `model_file.write` stores, by file name.

    Normalisation is folded into the weights, so all inputs are SI. Parts that are computed once per frame or groom are stored in
    float16 if they include a deep map, which keeps the file small (0.006 mm error on average on the shipped shot); all
    computation is in float32.

    - `encoder.onnx`: `shape` (S, 72) scalp-local root-relative metres -> `code` (S, 32);
    - `strand.onnx`: `strand` (S, 142) -> `strand_part` (S, 256);
    - `frame.onnx`: `frame` (1, F) -> `frame_part` (1, 256), and if the frame also changes the weights of the tail,
      `middle` (256, 256) and `out` (256, 72);
    - `tail.onnx`: `strand_part` (S, 256), the outputs of `frame.onnx`, `anchor` (S, 72) offsets of the held bind pose,
      `edges` (S, 72) rest edges of vertices 0 to 23, the first zero -> `offsets` (S, 72), `displacement` (S, 72).
    """
    into = None if autoencoder.into is None else _folded(autoencoder.into, autoencoder.mean, autoencoder.scale)
    encoder = [_folded(autoencoder.encoder[0], autoencoder.mean, autoencoder.scale, True), *autoencoder.encoder[1:]]
    return {
        "encoder.onnx": _encoder_graph(encoder, into),
        "strand.onnx": _strand_graph(net),
        "frame.onnx": _frame_graph(net, output),
        "tail.onnx": _tail_graph(net, output),
    }


def _folded(
    layer: nn.Linear, mean: torch.Tensor, scale: torch.Tensor, half: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """(in, out) weight and (out,) bias of `layer((x - mean) * scale)`, summed in float64.

    half: use the weight rounded to float16, so that the rounding acts on x - mean and not on x.
    """
    weight = layer.weight.detach().double() * scale.double()
    if half:
        weight = weight.half().double()
    bias = torch.zeros(len(weight)) if layer.bias is None else layer.bias.detach()
    bias = bias.double().to(weight.device) - weight @ mean.double()
    return weight.T.float().cpu().numpy(), bias.float().cpu().numpy()


def _weights(layer: nn.Linear | tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return layer if isinstance(layer, tuple) else (_array(layer), layer.bias.detach().float().cpu().numpy())


class _Graph(OnnxGraph):
    """A graph of layers; weights that follow a deep map of the frame are stored in float16."""

    def linear(self, value: str, layer, output: str | None = None, *, half: bool = False) -> str:
        """x W^T + b of a linear layer, or of its folded arrays; `half` stores W in float16."""
        output = output or f"linear{len(self.nodes)}"
        weight, bias = _weights(layer)
        stored = (self.half if half else self.constant)(f"{output}.weight", weight)
        return self.node("Gemm", [value, stored, self.constant(f"{output}.bias", bias)], output)

    def mlp(self, value: str, layers, output: str) -> str:
        """Layers as in `nn.Sequential`: linear ones (or their folded arrays) with ReLU between, stored in float16."""
        last = len(layers) - 1
        for i, layer in enumerate(layers):
            value = (
                self.node("Relu", [value], f"relu{len(self.nodes)}")
                if isinstance(layer, nn.ReLU)
                else self.linear(value, layer, output if i == last else None, half=True)
            )
        return value

    def half(self, name: str, array: np.ndarray) -> str:
        """A constant stored in float16 and read as float32."""
        with np.errstate(over="ignore"):  # `constant` refuses infinity
            stored = self.constant(f"{name}.half", array.astype(np.float16))
        self.nodes.append(self.helper.make_node("Cast", [stored], [name], to=1))
        return name


def _encoder_graph(layers, into) -> bytes:
    graph = _Graph("encoder", REMEDIES["strands"])
    if into is None:
        graph.mlp("shape", layers, "code")
    else:
        graph.node("Add", [graph.linear("shape", into, "flat"), graph.mlp("shape", layers, "bent")], "code")
    return graph.finish({"shape": ("S", SHAPE)}, {"code": ("S", len(_weights(layers[-1])[1]))})


def _strand_graph(net: StrandNet) -> bytes:
    half = net.strand_encoder is not None
    graph, layer = _Graph("strand", REMEDIES["strands"]), _folded(net.strand, net.strand_mean, net.strand_scale, half)
    if half:
        first = _folded(net.strand_encoder[0], net.strand_mean, net.strand_scale, True)
        graph.mlp("strand", [first, *net.strand_encoder[1:]], "bent")
        graph.node("Add", [graph.linear("strand", layer, "flat", half=True), "bent"], "strand_part")
    else:
        graph.linear("strand", layer, "strand_part")
    return graph.finish({"strand": ("S", len(layer[0]))}, {"strand_part": ("S", len(layer[1]))})


def _frame_graph(net: StrandNet, output: str) -> bytes:
    """The body's part of the first layer, and the weights that a frame changes."""
    half = net.encoder is not None
    graph, layer = _Graph("frame", REMEDIES["strands"]), _folded(net.frame, net.frame_mean, net.frame_scale, half)
    hidden, outputs = len(layer[1]), {"frame_part": (1, len(layer[1]))}
    if not half:
        graph.linear("frame", layer, "frame_part")
        return graph.finish({"frame": (1, len(layer[0]))}, outputs)
    deep = [_folded(net.encoder[0], net.frame_mean, net.frame_scale, True), *net.encoder[1:]]
    if net.motion == "encoder":
        graph.mlp("frame", deep, "bent")
    else:
        graph.mlp("frame", deep, "deep")
        changes = {"middle": (net.middle, net.middle_change), "out": (net.out, net.out_change)}
        sizes = [hidden, hidden, hidden, *(change.to_terms.out_features for _, change in changes.values())]
        parts = ["bent", "middle.deep", "out.deep", "middle.terms", "out.terms"]
        graph.nodes.append(
            graph.helper.make_node("Split", ["deep", graph.constant("sizes", np.array(sizes))], parts, axis=1)
        )
        graph.constant("one", np.float32(1))
        for name, (plain, change) in changes.items():
            graph.node("Add", [f"{name}.deep", "one"], f"{name}.factor")
            graph.node("Add", [f"{name}.terms", "one"], f"{name}.weights")
            read = _read_out(output) if name == "out" else np.eye(plain.out_features, dtype=np.float32)
            graph.half(f"{name}.to_terms", _array(change.to_terms))
            graph.half(f"{name}.back", _array(change.back) @ read)
            terms = graph.node("Mul", [f"{name}.to_terms", f"{name}.weights"], f"{name}.weighed")
            graph.half(f"{name}.plain", _array(plain) @ read)
            whole = graph.node(
                "Add",
                [f"{name}.plain", graph.node("MatMul", [terms, f"{name}.back"], f"{name}.change")],
                f"{name}.whole",
            )
            rows = graph.node("Transpose", [f"{name}.factor"], f"{name}.rows")
            graph.node("Mul", [whole, rows], name)
            outputs[name] = (hidden, plain.out_features)
    graph.node("Add", [graph.linear("frame", layer, "flat", half=True), "bent"], "frame_part")
    return graph.finish({"frame": (1, len(layer[0]))}, outputs)


def _tail_graph(net: StrandNet, output: str) -> bytes:
    """Second layer, output layer, and `networks.deform` in ONNX, so that all of it runs in the runtime's chunks."""
    graph, hidden, width = _Graph("tail", REMEDIES["strands"]), net.middle.in_features, net.out.out_features
    inputs = {"strand_part": ("S", hidden), "frame_part": (1, hidden), "anchor": ("S", width), "edges": ("S", width)}
    if net.motion == "modulated":
        inputs |= {"middle": (hidden, hidden), "out": (hidden, width)}
    else:
        graph.constant("middle", _array(net.middle))
        graph.constant("out", _array(net.out) @ _read_out(output))
    value = graph.node("Relu", [graph.node("Add", ["strand_part", "frame_part"], "sum")], "first")
    bias = graph.constant("middle.bias", _weights(net.middle)[1])
    value = graph.node("Relu", [graph.node("Gemm", [value, "middle", bias], "linear")], "second")
    graph.node("Gemm", [value, "out", graph.constant("out.bias", _weights(net.out)[1] @ _read_out(output))], "offsets")
    graph.node("Sub", ["offsets", "anchor"], "change" if output == "direction" else "displacement")
    if output == "direction":
        _turned_edges(graph, width // 3)
    return graph.finish(inputs, {"offsets": ("S", width), "displacement": ("S", width)})


def _turned_edges(graph: _Graph, count: int) -> None:
    """`change`, `edges` (S, 3 count) -> `displacement`: edges turn and keep their length.

    Sums over x, y, z, their spreading, and the running sum along the strand are matrix products, so that all arrays stay
    flat: this is three times as fast in runtimes as sums over rows of three and a scan.
    """
    sums, eye = np.kron(np.eye(count), np.ones((3, 1))), np.eye(3)
    graph.constant("sums", sums.astype(np.float32))
    graph.constant("spread", sums.T.astype(np.float32))
    graph.constant("running", np.kron(np.triu(np.ones((count, count))), eye).astype(np.float32))
    graph.constant("tiny", np.float32(1e-18))

    def lengths(vectors: str) -> str:
        squares = graph.node(
            "MatMul", [graph.node("Mul", [vectors, vectors], f"{vectors}.squares"), "sums"], f"{vectors}.sum"
        )
        return graph.node("Sqrt", [graph.node("Max", [squares, "tiny"], f"{vectors}.some")], f"{vectors}.length")

    long = graph.node("MatMul", [lengths("edges"), "spread"], "long")
    graph.node("Add", ["edges", graph.node("Mul", [long, "change"], "bent")], "way")
    stretch = graph.node("Div", ["edges.length", lengths("way")], "stretch")
    turned = graph.node("Mul", ["way", graph.node("MatMul", [stretch, "spread"], "stretches")], "turned")
    graph.node("MatMul", [graph.node("Sub", [turned, "edges"], "turn"), "running"], "displacement")


def _read_out(output: str) -> np.ndarray:
    """(3 K, 3 K) float32, multiplied from the right: what `networks.deform` does to offsets first."""
    along = smoothing() if output == "direction" else np.eye(K)
    along[:CLAMPED] = 0
    return np.kron(along.T, np.eye(3)).astype(np.float32)


def _array(layer: nn.Linear) -> np.ndarray:
    """(in, out) weight."""
    return layer.weight.detach().T.float().cpu().numpy()
