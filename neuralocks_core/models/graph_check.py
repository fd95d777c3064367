# SPDX-License-Identifier: Apache-2.0
"""Which ONNX graphs of a model file are run: a fixed sequence of the operations that trainings write, with all numbers in the graph.

Others could run for ever, fill the memory, draw random numbers or read other files. The graph is read as protobuf, whose field numbers
are those of onnx.proto, because the package onnx is not needed to run a model.
"""

from neuralocks_core.models.graph_sizes import OPERATIONS, oversized
from neuralocks_core.models.protobuf import fields

_GRAPH, _FUNCTIONS = 7, 25
"""Fields of ModelProto. A function may have the name of an operation."""
_NODE, _INITIALIZER, _SPARSE = 1, 5, 15
"""Fields of GraphProto."""
_OPERATION, _DOMAIN = 4, 7
"""Fields of NodeProto."""
_EXTERNAL, _LOCATION = 13, 14
"""Fields of TensorProto."""


def odd_part(graph: bytes) -> str:
    """What an ONNX file holds that none of ours does, in words for a user; "" if there is nothing.

    Raises:
        ValueError: it is damaged.
    """
    for field, value in fields(graph):
        if field == _FUNCTIONS:
            return "functions of its own"
        if field == _GRAPH and (odd := _odd_part_of_graph(value)):
            return odd
    return ""


def _odd_part_of_graph(graph) -> str:
    for field, value in fields(graph):
        if field == _SPARSE:
            return "sparse numbers"
        if field == _INITIALIZER and any(name == _EXTERNAL or name == _LOCATION and at for name, at in fields(value)):
            return "numbers that lie in another file"
        if field == _NODE:
            # If a field is there twice, readers may take either.
            for name, word in fields(value):
                if name == _DOMAIN and word != b"" or name == _OPERATION and word not in OPERATIONS:
                    return f"the operation '{bytes(word[:40]).decode('utf-8', 'replace')}'"
    return "arrays too large" if oversized(graph) else ""
