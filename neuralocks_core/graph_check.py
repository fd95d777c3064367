# SPDX-License-Identifier: Apache-2.0
"""Which ONNX graphs of a model file are run: a fixed sequence of the operations that trainings write, with all numbers in the graph.

Others could run for ever, fill the memory, draw random numbers or read other files. The graph is read as protobuf, whose field numbers
are those of onnx.proto, because the package onnx is not needed to run a model.
"""

from collections.abc import Iterator

OPERATIONS = frozenset(
    b"Add Cast Concat Div Gemm Greater MatMul Max Min Mul ReduceSum Relu Reshape Split Sqrt Sub Transpose Where".split()
)
_GRAPH, _FUNCTIONS = 7, 25
"""Fields of ModelProto. A function may have the name of an operation."""
_NODE, _INITIALIZER, _SPARSE = 1, 5, 15
"""Fields of GraphProto."""
_OPERATION, _DOMAIN = 4, 7
"""Fields of NodeProto."""
_EXTERNAL, _LOCATION = 13, 14
"""Fields of TensorProto."""
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
"""How a field is stored."""


def odd_part(graph: bytes) -> str:
    """What an ONNX file holds that none of ours does, in words for a user; "" if there is nothing.

    Raises:
        ValueError: it is damaged.
    """
    for field, value in _fields(graph):
        if field == _FUNCTIONS:
            return "functions of its own"
        if field == _GRAPH and (odd := _odd_part_of_graph(value)):
            return odd
    return ""


def _odd_part_of_graph(graph) -> str:
    for field, value in _fields(graph):
        if field == _SPARSE:
            return "sparse numbers"
        if field == _INITIALIZER and any(name == _EXTERNAL or name == _LOCATION and at for name, at in _fields(value)):
            return "numbers that lie in another file"
        if field == _NODE:
            # If a field is there twice, readers may take either.
            for name, word in _fields(value):
                if name == _DOMAIN and word != b"" or name == _OPERATION and word not in OPERATIONS:
                    return f"the operation '{bytes(word[:40]).decode('utf-8', 'replace')}'"
    return ""


def _fields(message) -> Iterator[tuple[int, memoryview | int]]:
    """Number and value of each field of a protobuf message: bytes, or a number."""
    if isinstance(message, int):
        raise ValueError("a number where a message should be")
    message, at = memoryview(message), 0
    while at < len(message):
        tag, at = _varint(message, at)
        kind = tag & 7
        if kind == _VARINT:
            value, at = _varint(message, at)
        else:
            size, at = _varint(message, at) if kind == _BYTES else ({_FIXED64: 8, _FIXED32: 4}.get(kind, -1), at)
            if not 0 <= size <= len(message) - at:
                raise ValueError("cut short" if size >= 0 else "not protobuf")
            value, at = message[at : at + size], at + size
        yield tag >> 3, value


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    """A number of at most 64 bits, and where it ends."""
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(message):
            break
        value |= (message[at] & 127) << shift
        at += 1
        if message[at - 1] < 128:
            return value, at
    raise ValueError("cut short")
