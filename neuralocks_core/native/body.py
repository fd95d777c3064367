# SPDX-License-Identifier: Apache-2.0
"""`body.h` for Python: one body in one pose, field by field."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from ctypes import c_float, c_int32, c_void_p

import numpy as np

VERTICES, MOST_NEIGHBOURS = 24, 8
"""Of a strand, and of a sample of skin: sizes of arrays in C."""


class Box(ctypes.Structure):
    """A `moving_skin.Box`."""

    _fields_ = (("low", c_float * 3), ("per_cell", c_float), ("strides", c_int32 * 3), ("count", c_int32))

    @classmethod
    def of(cls, box) -> Box:
        """What C needs of a box."""
        return cls((c_float * 3)(*box.low), 1 / box.cell, (c_int32 * 3)(*box.strides.tolist()), box.count)


class Body(ctypes.Structure):
    """A `near_body.PosedBody`. Pointers are to arrays that somebody else keeps."""

    _fields_ = (
        ("box", Box),
        ("marks", c_void_p),
        ("head_low", c_float * 3),
        ("head_per_cell", c_float),
        ("head_close", c_float),
        ("head_size", c_int32 * 3),
        ("head_values", c_void_p),
        ("start", c_void_p),
        ("near", c_void_p),
        ("planes", c_void_p),
        ("square", c_void_p),
        ("thick", c_void_p),
        ("counted", c_void_p),
        ("neighbours", c_int32),
    )


POINTED = {
    "marks": np.uint8, "head_values": np.float32, "start": np.int32, "near": np.int32, "planes": np.float32,
    "square": np.float32, "thick": np.float32, "counted": np.float32,
}  # fmt: skip
"""Type of each array that a field points to."""


def filled(fields: Mapping[str, object]) -> tuple[Body, list[np.ndarray]]:
    """A Body with these fields, others 0, and the arrays that must be kept as long as it is in use."""
    body, kept = Body(), []
    for name, value in fields.items():
        if name in POINTED:
            kept.append(np.ascontiguousarray(value, POINTED[name]))
            value = at(kept[-1])
        setattr(body, name, tuple(value) if name in ("head_low", "head_size") else value)
    return body, kept


def at(array: np.ndarray) -> c_void_p:
    """Pointer to an array's first element."""
    return c_void_p(array.ctypes.data)
