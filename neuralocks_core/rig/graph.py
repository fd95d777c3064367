# SPDX-License-Identifier: Apache-2.0
"""A rig model as an ONNX graph with a batch axis, for engines and crowds."""

import numpy as np

from neuralocks_core.errors import NeuralocksError


def rig_graph(model) -> bytes:
    """ONNX bytes: input `features` (B, F) float32, output `turns` (B, N, 4) wxyz, as `RigModel.evaluate`."""
    try:
        import onnx
        from onnx import TensorProto, helper, numpy_helper
    except ImportError:
        raise NeuralocksError(
            "onnx: not installed, it writes the model's graph; pip install 'neuralocks[train]'"
        ) from None
    nodes, constants = [], []

    def constant(name, value):
        constants.append(
            numpy_helper.from_array(np.ascontiguousarray(value, dtype=getattr(value, "dtype", np.float32)), name)
        )
        return name

    def node(kind, inputs, output, **attributes):
        nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output

    limits = np.asarray(model.limits, np.float32)
    value = node("Min", ["features", constant("most", limits)], "capped")
    value = node("Max", [value, constant("least", -limits)], "clipped")
    for index, (weight, bias) in enumerate(model.layers):
        names = [value, constant(f"weight{index}", weight), constant(f"bias{index}", bias)]
        value = node("Gemm", names, f"layer{index}", transB=1)
        if index + 1 < len(model.layers):
            value = node("Relu", [value], f"relu{index}")
    size = np.float32(np.sin(model.max_angle / 2))
    shape = constant("shape", np.array([-1, len(model.chains), 3], np.int64))
    raw = node("Reshape", [value, shape], "raw")
    square = node(
        "ReduceSum",
        [node("Mul", [raw, raw], "squares"), constant("last", np.array([2], np.int64))],
        "square",
        keepdims=1,
    )
    square = node("Add", [square, constant("one", np.float32(1))], "denominator")
    scale = node("Div", [constant("size", size), node("Sqrt", [square], "root")], "scale")
    vector = node("Mul", [raw, scale], "vector")
    rest = node("Div", [constant("size2", size * size), square], "rest")
    scalar = node("Sqrt", [node("Add", [rest, constant("floor", np.float32(1) - size * size)], "scalar2")], "scalar")
    node("Concat", [scalar, vector], "turns", axis=2)
    graph = helper.make_graph(
        nodes,
        "rig",
        [helper.make_tensor_value_info("features", TensorProto.FLOAT, ["avatars", model.inputs])],
        [helper.make_tensor_value_info("turns", TensorProto.FLOAT, ["avatars", len(model.chains), 4])],
        constants,
    )
    file = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9, producer_name="neuralocks"
    )
    onnx.checker.check_model(file)
    return file.SerializeToString()
