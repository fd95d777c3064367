# SPDX-License-Identifier: Apache-2.0
"""How large the arrays of an ONNX graph become, told from its shapes alone: a file of a kilobyte can ask for all memory, already when
it is loaded, because runtimes compute at once what does not depend on the inputs.

Only the operations that `graph_check` lets through are known. Field numbers are those of onnx.proto.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from itertools import zip_longest

import numpy as np

from neuralocks_core.models.protobuf import fields, numbers

MANY = 100_003
"""Rows of the inputs whose number is open, such as strands."""
MOST_FIXED, MOST_EACH = 1 << 22, 1 << 14
"""Elements of an array for one such row, and for each of MANY; no array of our models has an eighth of that."""
MOST_NODES = 1000
_NODE, _INITIALIZER, _INPUT = 1, 5, 11
"""Fields of GraphProto."""
_INT64 = 7
"""Of TensorProto.DataType."""

Shape = tuple[int, ...]


def oversized(graph) -> bool:
    """Whether an array of a GraphProto is larger than any of ours, or grows faster than its inputs.

    Raises:
        ValueError: it is damaged, or its shapes do not fit each other.
    """
    if sum(number == _NODE for number, _ in fields(graph)) > MOST_NODES:
        return True
    try:
        return not (_fits(graph, 1, MOST_FIXED) and _fits(graph, MANY, MOST_EACH * MANY))
    except (KeyError, IndexError, AttributeError, TypeError):
        raise ValueError("its shapes do not fit each other") from None


def _fits(graph, rows: int, most: int) -> bool:
    """Whether its arrays have at most so many elements each if open dimensions are `rows`."""
    told = _collected(graph)
    shapes: dict[bytes, Shape] = {}
    values: dict[bytes, list[int] | None] = {}

    def keep(name: bytes, shape: Shape) -> bool:
        if name in shapes:
            raise ValueError("two of its arrays have one name")
        shapes[name] = shape
        return math.prod(shape) <= most

    kept = [keep(*_input(each, rows)) for each in told[_INPUT]]
    for each in told[_INITIALIZER]:
        name, shape, values[name] = _initializer(each)
        kept.append(keep(name, shape))
    for each in told[_NODE]:
        node = _collected(each)
        names, outputs = ([bytes(name) for name in node[i]] for i in (1, 2))
        made = _RULES[_text(node[4])](
            [shapes[name] for name in names], [values.get(name) for name in names], _options(node[5])
        )
        kept += [keep(name, shape) for name, shape in zip(outputs, made, strict=True)]
        if not all(kept):
            return False
    return all(kept)


def _collected(message) -> dict[int, list]:
    found = defaultdict(list)
    for number, value in fields(message):
        found[number].append(value)
    return found


def _text(values: list) -> bytes:
    (value,) = values or [b""]
    return bytes(value)


def _input(message, rows: int) -> tuple[bytes, Shape]:
    """Name and shape of a ValueInfoProto."""
    told = _collected(message)
    (kind,) = told[2]
    (tensor,) = _collected(kind)[1]
    (shape,) = _collected(tensor)[2]
    sizes = [numbers(_collected(size)[1]) or [rows] for size in _collected(shape)[1]]
    return _text(told[1]), _checked([size for (size,) in sizes])


def _initializer(message) -> tuple[bytes, Shape, list[int] | None]:
    """Name and shape of a TensorProto, and its numbers if they are whole."""
    told = _collected(message)
    shape, whole = _checked(numbers(told[1])), None
    if numbers(told[2])[-1:] == [_INT64]:
        whole = np.frombuffer(_text(told[9]), "<i8").tolist() or numbers(told[7])
    return _text(told[8]), shape, whole


def _options(messages: list) -> dict[bytes, list[int]]:
    """Names and whole numbers, one or several, of AttributeProtos."""
    found: dict[bytes, list[int]] = {}
    for message in messages:
        told = _collected(message)
        if (name := _text(told[1])) in found or len(told[3]) > 1 or told[3] and told[8]:
            raise ValueError("it has an option twice")
        found[name] = numbers(told[3] + told[8])
    return found


def _checked(shape: Sequence[int]) -> Shape:
    if len(shape) > 4 or any(size < 0 for size in shape):
        raise ValueError("its shapes do not fit each other")
    return tuple(shape)


def _same(shapes, values, options) -> list[Shape]:
    return shapes[:1]


def _broadcast(shapes, values, options) -> list[Shape]:
    return [_together(*shapes)]


def _together(*shapes: Shape) -> Shape:
    """Their shape as one of them is repeated along the others, as numpy does."""
    made = []
    for sizes in zip_longest(*(shape[::-1] for shape in shapes), fillvalue=1):
        (size,) = {size for size in sizes if size != 1} or {1}
        made.append(size)
    return _checked(made[::-1])


def _matmul(shapes, values, options) -> list[Shape]:
    left, right = shapes
    if left[-1] != right[-2] or len(left) < 2:
        raise ValueError("its shapes do not fit each other")
    return [(*_together(left[:-2], right[:-2]), left[-2], right[-1])]


def _gemm(shapes, values, options) -> list[Shape]:
    left, right = (
        shape[::-1] if options.get(turned, [0])[-1] else shape
        for shape, turned in zip(shapes, (b"transA", b"transB"), strict=False)
    )
    return _matmul([left, right], values, options)


def _concat(shapes, values, options) -> list[Shape]:
    (axis,), made = options[b"axis"], list(shapes[0])
    made[axis] = sum(shape[axis] for shape in shapes)
    return [tuple(made)]


def _split(shapes, values, options) -> list[Shape]:
    axis, made = options.get(b"axis", [0])[-1], []
    for size in values[1]:
        part = list(shapes[0])
        part[axis] = size
        made.append(_checked(part))
    return made


def _reduced(shapes, values, options) -> list[Shape]:
    axes = [axis % len(shapes[0]) for axis in values[1]]
    made = [1 if i in axes else size for i, size in enumerate(shapes[0])]
    if not options.get(b"keepdims", [1])[-1]:
        made = [size for i, size in enumerate(made) if i not in axes]
    return [tuple(made)]


def _reshaped(shapes, values, options) -> list[Shape]:
    made = [shapes[0][i] if size == 0 else size for i, size in enumerate(values[1])]
    if made.count(-1) == 1:
        rest = -math.prod(made)
        made[made.index(-1)] = math.prod(shapes[0]) // rest if rest else 0
    if math.prod(made) != math.prod(shapes[0]):
        raise ValueError("its shapes do not fit each other")
    return [_checked(made)]


def _transposed(shapes, values, options) -> list[Shape]:
    order = options.get(b"perm", list(range(len(shapes[0])))[::-1])
    return [tuple(shapes[0][i] for i in order)]


_RULES = {
    **dict.fromkeys(b"Cast Relu Sqrt".split(), _same),
    **dict.fromkeys(b"Add Div Greater Max Min Mul Sub Where".split(), _broadcast),
    b"MatMul": _matmul,
    b"Gemm": _gemm,
    b"Concat": _concat,
    b"Split": _split,
    b"ReduceSum": _reduced,
    b"Reshape": _reshaped,
    b"Transpose": _transposed,
}
"""Shapes of outputs from shapes of inputs, their whole numbers, and options."""
OPERATIONS = frozenset(_RULES)
