# SPDX-License-Identifier: Apache-2.0
"""Models and graphs that are none of ours, or damaged, are refused clearly."""

import json

import numpy as np
import pytest

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.deformation.strand_session import StrandSession
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import RANGES
from neuralocks_core.models import model_file
from neuralocks_core.models.runtime import StrandModel

pytest.importorskip("torch", reason="the extra 'train' is not installed")
from tests.strand_models import rewritten

SPEC = BoundarySpec()
CLUMPING = SPEC.slices["material"].start + list(RANGES).index("clumping")


@pytest.mark.parametrize(
    ("changes", "fact"),
    [
        ({"tail_onnx": None}, "lacks tail.onnx"),
        ({"model_json": b"{"}, "damaged"),
        ({"model_json": json.dumps({"format": 99, "kind": "strands"})}, "update neuralocks"),
        ({"model_json": json.dumps({"format": 1, "kind": "cloth"})}, "unknown here"),
        (
            {"model_json": json.dumps({"format": 1, "kind": "strands", "boundary": {"bins": [1]}})},
            r"frame \(278\), not frame",
        ),
        ({"model_json": b'{"format": 1, "kind": []}'}, "unknown here"),
        ({"model_json": json.dumps({"format": 1, "kind": "strands", "training": [1]})}, "'training' is not a table"),
        ({"model_json": b'{"format": ' + b"1" * 5000 + b"}"}, "damaged"),
        ({"model_json": b"\xff"}, "damaged"),
        ({"model_json": json.dumps({"format": 1, "kind": "strands", "boundary": 5})}, "boundary history"),
        (
            {"model_json": json.dumps({"format": 1, "kind": "strands", "boundary": {"bins": [-1]}})},
            "impossible time step",
        ),
        (
            {"model_json": json.dumps({"format": 1, "kind": "strands", "boundary": {"pose_joints": [["neck"]]}})},
            r"history has values of a wrong kind; get an undamaged copy$",
        ),
        (
            {"model_json": json.dumps({"format": 1, "kind": "strands", "boundary": {}, "anchored": "no"})},
            "'anchored' is neither true nor false",
        ),
        ({"model_json": json.dumps({"format": 1, "kind": "strands"})}, "boundary history"),
        ({"model_json": json.dumps({"format": 1, "kind": "strands", "credits": "me"})}, "'credits' is not a list"),
        ({"tail_onnx": b"nonsense"}, "cannot be loaded"),
    ],
)
def test_damaged_models_are_refused_in_one_line(path, tmp_path, changes, fact):
    with pytest.raises(NeuralocksError, match=fact) as caught:
        StrandModel.load(rewritten(path, tmp_path / "m.neuralocks", **changes))
    assert "\n" not in str(caught.value) and str(caught.value).startswith(f"{tmp_path / 'm.neuralocks'}: ")


def test_graphs_in_each_others_place_are_refused(path, tmp_path):
    graphs = model_file.read(path).graphs
    changes = {"encoder_onnx": graphs["strand.onnx"], "strand_onnx": graphs["encoder.onnx"]}
    with pytest.raises(NeuralocksError, match=r"encoder.onnx reads strand \(142\), not shape \(72\); get"):
        StrandModel.load(rewritten(path, tmp_path / "m.neuralocks", **changes))


def encoder(onnx, nodes, constants=()):
    """A graph with the inputs and outputs of a strand encoder."""
    described = onnx.helper.make_tensor_value_info
    read, given = (described(n, onnx.TensorProto.FLOAT, ["S", k]) for n, k in (("shape", 72), ("code", 32)))
    graph = onnx.helper.make_graph(nodes, "g", [read], [given], constants)
    return onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=8)


def test_a_graph_that_fails_while_it_is_computed_is_one_line(path, strands, tmp_path, monkeypatch):
    """As one would whose shapes nobody had looked at before."""
    onnx = pytest.importorskip("onnx")
    monkeypatch.setattr("neuralocks_core.models.graph_check.oversized", lambda graph: False)
    nodes = [onnx.helper.make_node("Reshape", ["shape", "rows"], ["code"])]
    graph = encoder(onnx, nodes, [onnx.helper.make_tensor("rows", onnx.TensorProto.INT64, [2], [7, 32])])
    broken = rewritten(path, tmp_path / "m.neuralocks", encoder_onnx=graph.SerializeToString())
    with pytest.raises(NeuralocksError, match="encoder.onnx cannot be computed ") as caught:
        StrandSession(StrandModel.load(broken), strands)
    assert "\n" not in str(caught.value)


def test_graphs_that_are_none_of_ours_are_never_loaded(path, tmp_path):
    """They may run for ever, fill the memory, or read another file."""
    onnx = pytest.importorskip("onnx")
    node = onnx.helper.make_node
    endless, outside, function, foreign = (
        onnx.load_model_from_string(model_file.read(path).graphs["encoder.onnx"]) for _ in range(4)
    )
    body = encoder(onnx, [node("Relu", ["shape"], ["code"])]).graph
    endless.graph.node.append(node("Loop", ["", "", "code"], ["all"], body=body))
    outside.graph.initializer[0].data_location = onnx.TensorProto.EXTERNAL
    function.functions.append(onnx.helper.make_function("", "Gemm", ["a"], ["b"], [node("Relu", ["a"], ["b"])], []))
    foreign.graph.node[0].domain = "com.microsoft"
    for graph, odd in (
        (endless, "the operation 'Loop'"),
        (outside, "numbers that lie in another file"),
        (function, "functions of its own"),
        (foreign, "the operation 'com.microsoft'"),
    ):
        odd_model = rewritten(path, tmp_path / "m.neuralocks", encoder_onnx=graph.SerializeToString())
        with pytest.raises(NeuralocksError, match=f"encoder.onnx has {odd}, as no model of this version has; get"):
            StrandModel.load(odd_model)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
@pytest.mark.parametrize("name", model_file.KINDS["strands"])
def test_a_model_that_gives_no_finite_hair_is_refused(path, strands, tmp_path, name, value):
    """Such weights would fill a bake with NaN, and nothing else reports it."""
    onnx = pytest.importorskip("onnx")
    file = model_file.read(path)
    graph = onnx.load_model_from_string(file.graphs[name])
    largest = max(graph.graph.initializer, key=lambda tensor: len(tensor.raw_data))
    array = onnx.numpy_helper.to_array(largest)
    with np.errstate(over="ignore"):  # some are stored in half precision
        largest.CopyFrom(onnx.numpy_helper.from_array(np.full_like(array, value), largest.name))
    graphs = {**file.graphs, name: graph.SerializeToString()}
    damaged = model_file.write(tmp_path / "damaged.neuralocks", file.meta, graphs)
    vector = np.ones(SPEC.size, np.float32)
    vector[CLUMPING] = 0
    with pytest.raises(NeuralocksError, match=r"damaged.neuralocks: \w+.onnx gives no finite hair; ") as caught:
        session = StrandSession(StrandModel.load(damaged), strands)
        session.anchor(np.zeros_like(vector))
        session.displacement(vector)
    assert "\n" not in str(caught.value)
