# SPDX-License-Identifier: Apache-2.0
"""From trained torch modules to the four ONNX graphs of a model file."""

from __future__ import annotations

import numpy as np
import torch
from torch import nn

from neuralocks_core.training.autoencoder import StrandAutoencoder
from neuralocks_core.training.networks import StrandNet

OPSET = 17
IR_VERSION = 8  # the oldest that goes with this opset, for the oldest onnxruntime a user may have


def strand_graphs(
    autoencoder: StrandAutoencoder, net: StrandNet, output: str = "direction"
) -> dict[str, bytes]:
    """The graphs that `model.write` stores, by file name.

    Normalisation is folded into the weights, so all inputs are SI:

    The deep maps, of a strand's shape and of the frame, hold most weights and are stored in float16, which keeps the
    file small; all is computed in float32.

    - `encoder.onnx`: `shape` (S, 72) scalp-local root-relative metres -> `code` (S, 32);
    - `strand.onnx`: `strand` (S, 70) -> `strand_part` (S, 256);
    - `frame.onnx`: `frame` (1, F) -> `frame_part` (1, P), P = 256, or 768 where the frame also scales both hidden
      layers;
    - `tail.onnx`: `strand_part` (S, 256), `frame_part` (1, P), `anchor` (S, 72) offsets of the held bind pose, `edges`
      (S, 72) rest edges of vertices 0 to 23, the first zero -> `offsets` (S, 72), `displacement` (S, 72).
    """
    into = None if autoencoder.into is None else _folded(autoencoder.into, autoencoder.mean, autoencoder.scale)
    encoder = [_folded(autoencoder.encoder[0], autoencoder.mean, autoencoder.scale, True), *autoencoder.encoder[1:]]
    frame = _folded(net.frame, net.frame_mean, net.frame_scale)
    deep = None
    if net.encoder is not None:
        deep = [_folded(net.encoder[0], net.frame_mean, net.frame_scale, True), *net.encoder[1:]]
        # What scales the hidden layers has no linear part, and is one before the deep map adds to it.
        wider = net.encoder[-1].out_features - net.frame.out_features
        frame = (np.pad(frame[0], ((0, 0), (0, wider))), np.pad(frame[1], (0, wider), constant_values=1.0))
    return {
        "encoder.onnx": _encoder_graph(encoder, into),
        "strand.onnx": _linear_graph("strand", _folded(net.strand, net.strand_mean, net.strand_scale)),
        "frame.onnx": _linear_graph("frame", frame, deep),
        "tail.onnx": _tail_graph(net, output),
    }


def _folded(
    layer: nn.Linear, mean: torch.Tensor, scale: torch.Tensor, half: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """(in, out) weight and (out,) bias of `layer((x - mean) * scale)`, summed in float64.

    half: with the weight as float16 holds it, so that its rounding meets x - mean and not x.
    """
    weight = layer.weight.detach().double() * scale.double()
    if half:
        weight = weight.half().double()
    bias = torch.zeros(len(weight)) if layer.bias is None else layer.bias.detach()
    bias = bias.double().to(weight.device) - weight @ mean.double()
    return weight.T.float().cpu().numpy(), bias.float().cpu().numpy()


def _weights(layer: nn.Linear | tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    if isinstance(layer, tuple):
        return layer
    return layer.weight.detach().T.float().cpu().numpy(), layer.bias.detach().float().cpu().numpy()


class _Graph:
    """A chain of layers under construction."""

    def __init__(self, name: str):
        from onnx import helper, numpy_helper

        self.helper, self.numpy_helper = helper, numpy_helper
        self.name, self.nodes, self.constants = name, [], []

    def linear(self, value: str, layer, output: str | None = None, *, half: bool = False) -> str:
        output = output or f"linear{len(self.nodes)}"
        weight, bias = _weights(layer)
        if half:
            stored = self.constant(f"{output}.half", weight.astype(np.float16))
            node = self.helper.make_node("Cast", [stored], [f"{output}.weight"], to=1)  # float32
            self.nodes.append(node)
        else:
            self.constant(f"{output}.weight", weight)
        return self.node("Gemm", [value, f"{output}.weight", self.constant(f"{output}.bias", bias)], output)

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

    def constant(self, name: str, array: np.ndarray) -> str:
        self.constants.append(self.numpy_helper.from_array(np.ascontiguousarray(array), name))
        return name

    def node(self, kind: str, inputs: list[str], output: str) -> str:
        self.nodes.append(self.helper.make_node(kind, inputs, [output]))
        return output

    def finish(self, inputs: dict[str, tuple], outputs: dict[str, tuple]) -> bytes:
        import onnx

        def describe(values):
            return [
                self.helper.make_tensor_value_info(k, onnx.TensorProto.FLOAT, v) for k, v in values.items()
            ]

        graph = self.helper.make_graph(
            self.nodes, self.name, describe(inputs), describe(outputs), self.constants
        )
        model = self.helper.make_model(
            graph,
            opset_imports=[self.helper.make_opsetid("", OPSET)],
            ir_version=IR_VERSION,
            producer_name="neuralocks",
        )
        onnx.checker.check_model(model)
        return model.SerializeToString(deterministic=True)


def _encoder_graph(layers, into) -> bytes:
    graph = _Graph("encoder")
    if into is None:
        graph.mlp("shape", layers, "code")
    else:
        graph.node("Add", [graph.linear("shape", into, "flat"), graph.mlp("shape", layers, "bent")], "code")
    return graph.finish({"shape": ("S", 72)}, {"code": ("S", len(_weights(layers[-1])[1]))})


def _linear_graph(name: str, layer, deep=None) -> bytes:
    graph, (weight, bias) = _Graph(name), layer
    if deep is None:
        graph.linear(name, layer, f"{name}_part")
    else:
        graph.node("Add", [graph.linear(name, layer, "flat"), graph.mlp(name, deep, "deep")], f"{name}_part")
    rows = "S" if name == "strand" else "B"
    return graph.finish({name: (rows, len(weight))}, {f"{name}_part": (rows, len(bias))})


def _tail_graph(net: StrandNet, output: str) -> bytes:
    """Second layer, output layer, and `networks.deform` written in ONNX, so that all of it runs in the
    runtime's chunks."""
    graph, hidden, width = _Graph("tail"), net.middle.in_features, net.out.out_features
    count = width // 3
    parts = ["frame_part"]
    if net.motion == "modulated":
        parts = ["added", "factor1", "factor2"]
        graph.nodes.append(graph.helper.make_node("Split", ["frame_part"], parts, axis=1))
    value = graph.node("Relu", [graph.node("Add", ["strand_part", parts[0]], "sum")], "first")
    if parts[1:]:
        value = graph.node("Mul", [value, parts[1]], "first.scaled")
    value = graph.node("Relu", [graph.linear(value, net.middle)], "second")
    if parts[1:]:
        value = graph.node("Mul", [value, parts[2]], "second.scaled")
    graph.linear(value, net.out, "offsets")
    free = np.repeat(np.arange(count) >= 2, 3).astype(np.float32)
    graph.node("Sub", ["offsets", "anchor"], "change")
    graph.node(
        "Mul", ["change", graph.constant("free", free)], "o" if output == "direction" else "displacement"
    )
    if output == "direction":
        # Sums over x, y, z as a matrix product, so that all arrays stay (S, 72): three times as fast as sums over
        # rows of three.
        graph.constant("trio", np.kron(np.eye(count), np.ones((3, 3))).astype(np.float32))
        graph.constant("tiny", np.float32(1e-18))
        for name, source in (("l", "edges"), ("n", "v")):
            if name == "n":
                graph.node("Add", ["edges", graph.node("Mul", ["l", "o"], "lo")], "v")
            graph.node("MatMul", [graph.node("Mul", [source, source], f"{name}2"), "trio"], f"{name}sum")
            graph.node("Sqrt", [graph.node("Max", [f"{name}sum", "tiny"], f"{name}max")], name)
        graph.node("Mul", ["v", graph.node("Div", ["l", "n"], "stretch")], "turned")
        graph.node("Sub", ["turned", "edges"], "d")
        # A running sum along the strand as one matrix product, which runtimes do faster than a scan.
        running = np.kron(np.triu(np.ones((count, count))), np.eye(3)).astype(np.float32)
        graph.node("MatMul", ["d", graph.constant("running", running)], "displacement")
    inputs = {
        "strand_part": ("S", hidden),
        "frame_part": (1, len(parts) * hidden),
        "anchor": ("S", width),
        "edges": ("S", width),
    }
    return graph.finish(inputs, {"offsets": ("S", width), "displacement": ("S", width)})
