# SPDX-License-Identifier: Apache-2.0
"""A model file cannot ask for more memory than ours do: that is told from its graph before anything is computed."""

import numpy as np
import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models import model_file
from neuralocks_core.models.graph_check import odd_part
from neuralocks_core.models.runtime import StrandModel

onnx = pytest.importorskip("onnx", reason="the extra 'train' is not installed")
F, I = onnx.TensorProto.FLOAT, onnx.TensorProto.INT64
node = onnx.helper.make_node


def _graph(nodes, constants: dict, rows="S", wide=8) -> bytes:
    """A model (rows, wide) x -> y."""
    held = [onnx.numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()]
    ends = [onnx.helper.make_tensor_value_info(name, F, shape) for name, shape in (("x", [rows, wide]), ("y", None))]
    graph = onnx.helper.make_graph(nodes, "g", ends[:1], ends[1:], held)
    return onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)]).SerializeToString()


def _column(count: int) -> np.ndarray:
    return np.ones((count, 1), np.float32)


DOUBLING = [node("Concat", [f"c{i}", f"c{i}"], [f"c{i + 1}"], axis=0) for i in range(40)]
BOMBS = {
    "doubled again and again": ([*DOUBLING, node("Add", ["x", "c40"], ["y"])], {"c0": _column(1)}),
    "a column and a row": (
        [node("Add", ["a", "b"], ["c"]), node("MatMul", ["x", "c"], ["y"])],
        {"a": _column(9000), "b": _column(9000).T},
    ),
    "an outer product": ([node("MatMul", ["a", "b"], ["y"])], {"a": _column(9000), "b": _column(9000).T}),
    "the same by Gemm": ([node("Gemm", ["a", "a"], ["y"], transB=1)], {"a": _column(9000)}),
    "one long row": (
        [node("MatMul", ["a", "b"], ["c"]), node("Reshape", ["c", "to"], ["d"]), node("Mul", ["d", "b"], ["y"])],
        {"a": _column(2000), "b": _column(2000).T, "to": np.array([-1, 1])},
    ),
    "each strand with each": ([node("Gemm", ["x", "x"], ["y"], transB=1)], {}),
    "the same through a transpose": (
        [node("Transpose", ["x"], ["t"]), node("MatMul", ["x", "t"], ["y"])],
        {},
    ),
    "more steps than any of ours": (
        [node("Relu", ["x" if i == 0 else f"r{i}"], [f"r{i + 1}"]) for i in range(1001)],
        {},
    ),
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_what_grows_beyond_all_of_ours_is_refused(bomb):
    assert odd_part(_graph(*BOMBS[bomb])) == "arrays too large"


def test_it_is_refused_before_it_is_loaded(tmp_path):
    file = model_file.read(model_file.shipped())
    graphs = file.graphs | {"tail.onnx": _graph(*BOMBS["doubled again and again"])}
    path = model_file.write(tmp_path / "bomb.neuralocks", file.meta, graphs)
    with pytest.raises(NeuralocksError, match="bomb.neuralocks: tail.onnx has arrays too large, as no model"):
        StrandModel.load(path)


@pytest.mark.parametrize("rows", ["S", 3])
def test_every_operation_has_the_shape_that_onnx_infers(rows):
    """Sizes that `Add` joins at the end fit only then."""
    nodes = [
        node("Split", ["x", "sizes"], ["p", "q"], axis=-1),
        node("Concat", ["q", "p", "q"], ["c"], axis=1),
        node("Reshape", ["c", "to"], ["r"]),
        node("ReduceSum", ["r", "last"], ["s"], keepdims=1),
        node("ReduceSum", ["r", "last"], ["flat"], keepdims=0),
        node("Transpose", ["r"], ["t"], perm=[0, 2, 1]),
        node("MatMul", ["r", "t"], ["m"]),
        node("Where", ["above", "m", "one"], ["w"]),
        node("Cast", ["flat"], ["wide"], to=onnx.TensorProto.DOUBLE),
        node("Gemm", ["flat", "weight", "bias"], ["g"], transB=1),
        node("Div", ["s", "one"], ["d"]),
        node("Greater", ["one", "none"], ["above"]),
    ]
    nodes = [nodes[-1], *nodes[:-1], node("Add", ["g", "bias"], ["y"])]
    held = {
        "sizes": np.array([5, 3]),
        "to": np.array([0, 11, -1]),
        "last": np.array([-1]),
        "one": np.ones(1, np.float32),
        "none": np.zeros(1, np.float32),
        "weight": np.ones((7, 11), np.float32),
        "bias": np.ones(7, np.float32),
    }
    data = _graph(nodes, held, rows)
    assert odd_part(data) == ""
    inferred = onnx.shape_inference.infer_shapes(onnx.load_from_string(data), strict_mode=True, data_prop=True)
    sizes = {
        each.name: [d.dim_value or d.dim_param for d in each.type.tensor_type.shape.dim]
        for each in inferred.graph.value_info
    }
    assert sizes["r"] == [rows, 11, 1] and sizes["m"] == [rows, 11, 11] and sizes["g"] == [rows, 7]
    held["weight"] = np.ones((7, 12), np.float32)
    with pytest.raises(ValueError, match="do not fit"):
        odd_part(_graph(nodes, held, rows))


@pytest.mark.parametrize(
    "nodes",
    [
        [node("Add", ["x", "nothing"], ["y"])],
        [node("Split", ["x"], ["y", "z"])],
        [node("Concat", ["x", "x"], ["y"])],
        [node("ReduceSum", ["x"], ["y"])],
        [node("Relu", ["x"], ["y", "z"])],
        [node("Relu", ["x"], ["x"])],
    ],
)
def test_what_is_written_otherwise_than_ours_is_refused(nodes):
    with pytest.raises(ValueError):
        odd_part(_graph(nodes, {}))


@pytest.mark.parametrize("field", [b"\0\0", b"\x48\x01"])
def test_a_graph_of_millions_of_fields_is_not_read_to_its_end(field):
    """A file of a few kilobytes may unpack to it, and take minutes."""
    data = field * (2 << 20)
    for graph in (data, _field(7, data), _field(7, _field(5, data)), _field(7, _field(5, _field(1, data)))):
        with pytest.raises(ValueError, match="too many"):
            odd_part(graph)


def _field(number: int, content: bytes) -> bytes:
    size, left = bytearray(), len(content)
    while left > 127:
        size.append(left & 127 | 128)
        left >>= 7
    return bytes([number << 3 | 2, *size, left]) + content
