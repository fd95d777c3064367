# SPDX-License-Identifier: Apache-2.0
"""Reading the fields of a protobuf message whoever wrote it, without a schema: the package onnx is not needed to run a model."""

from collections.abc import Iterator

MOST = 1 << 14
"""Fields of one message, or numbers of one field: each takes this reader a microsecond, and a megabyte may hold half a million. No
message of ours has a tenth of that.
"""
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
"""How a field is stored."""


def fields(message) -> Iterator[tuple[int, memoryview | int]]:
    """Number and value of each field of a message: bytes, or a number.

    Raises:
        ValueError: it is damaged, or has more than MOST fields.
    """
    if isinstance(message, int):
        raise ValueError("a number where a message should be")
    message, at, count = memoryview(message), 0, 0
    while at < len(message):
        if (count := count + 1) > MOST:
            raise ValueError("too many fields")
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


def numbers(values) -> list[int]:
    """The whole numbers of a repeated field, one by one or packed, from all its values; negative ones are two's complements.

    Raises:
        ValueError: they are damaged, or more than MOST.
    """
    found: list[int] = []
    for value in values:
        if isinstance(value, int):
            found.append(value)
            continue
        at = 0
        while at < len(value):
            number, at = _varint(value, at)
            found.append(number)
            if len(found) > MOST:
                raise ValueError("too many numbers")
    return [number - (1 << 64) if number >> 63 else number for number in found]


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
