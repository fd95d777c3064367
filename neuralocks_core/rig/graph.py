# SPDX-License-Identifier: Apache-2.0
"""A rig model as an ONNX graph with a batch axis, for engines and crowds."""

import numpy as np

from neuralocks_core.models.model_file import REMEDIES
from neuralocks_core.models.onnx_graph import OnnxGraph

_FLOAT, _DOUBLE = 1, 11
"""Types of onnx.TensorProto."""


def rig_graph(model) -> bytes:
    """ONNX bytes of a `RigModel`: input `features` (B, F) float32, output `turns` (B, N, 4) wxyz, as `evaluate`.

    Raises:
        NeuralocksError: onnx is not installed.
    """
    graph = OnnxGraph("rig", REMEDIES["rig"])
    limits = np.asarray(model.limits, np.float32)
    # As in the header: NaN, which compares false, becomes the lower limit. Max and Min would pass it on.
    least = graph.constant("least", -limits)
    above = graph.node("Greater", ["features", least], "above")
    value = graph.node("Where", [above, "features", least], "raised")
    value = graph.node("Min", [value, graph.constant("most", limits)], "clipped")
    value = graph.node("Cast", [value], "wide", to=_DOUBLE)
    for index, (weight, bias) in enumerate(model.layers):
        if index == 0:  # in double precision, as `RigModel` does
            weight, bias = weight.astype(float), bias.astype(float)
        names = [value, graph.constant(f"weight{index}", weight), graph.constant(f"bias{index}", bias)]
        value = graph.node("Gemm", names, f"layer{index}", transB=1)
        if index == 0:
            value = graph.node("Cast", [value], "narrow", to=_FLOAT)
        if index + 1 < len(model.layers):
            value = graph.node("Relu", [value], f"relu{index}")
    joints = len(model.chains)
    shape = graph.constant("shape", np.array([-1, joints, 3], np.int64))
    _bounded_turns(graph, graph.node("Reshape", [value, shape], "raw"), np.float32(np.sin(model.max_angle / 2)))
    return graph.finish({"features": ("avatars", model.inputs)}, {"turns": ("avatars", joints, 4)})


def _bounded_turns(graph: OnnxGraph, raw: str, size: np.float32) -> None:
    """`kinematics.half_turns` of a value (B, N, 3) as the output `turns`; `size` is the sine of half the largest angle."""
    squares, last = graph.node("Mul", [raw, raw], "squares"), graph.constant("last", np.array([2], np.int64))
    square = graph.node("ReduceSum", [squares, last], "square", keepdims=1)
    square = graph.node("Add", [square, graph.constant("one", np.float32(1))], "denominator")
    scale = graph.node("Div", [graph.constant("size", size), graph.node("Sqrt", [square], "root")], "scale")
    vector = graph.node("Mul", [raw, scale], "vector")
    rest = graph.node("Div", [graph.constant("size2", size * size), square], "rest")
    floor = graph.constant("floor", np.float32(1) - size * size)
    scalar = graph.node("Sqrt", [graph.node("Add", [rest, floor], "scalar2")], "scalar")
    graph.node("Concat", [scalar, vector], "turns", axis=2)
