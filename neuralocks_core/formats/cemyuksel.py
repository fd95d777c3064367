# SPDX-License-Identifier: Apache-2.0
"""Cem Yuksel's `.hair` files."""

from __future__ import annotations

import struct

import numpy as np

from neuralocks_core.formats.raw import RawGroom, bad_file, big_endian, floats

_SEGMENTS, _POINTS, _THICKNESS, _TRANSPARENCY, _COLOR = 1, 2, 4, 8, 16
_KNOWN = _SEGMENTS | _POINTS | _THICKNESS | _TRANSPARENCY | _COLOR
_HEADER = struct.Struct("<4sIIIIfffff88s")


def read(content: bytes, subject: str) -> RawGroom:
    """Parse a .hair file (Z up).

    Args:
        content: the whole file.
        subject: what messages call it.

    Raises:
        NeuralocksError: it is truncated, or holds no points.
    """
    if len(content) < _HEADER.size:
        raise bad_file(subject, f"has {len(content)} bytes but the header has {_HEADER.size}", "it is truncated")
    _, strands, total, flags, segments, thickness, transparency, *color, _ = _HEADER.unpack_from(content)
    if flags != flags & _KNOWN and (swapped := int.from_bytes(content[12:16], "big")) == swapped & _KNOWN:
        raise big_endian(subject)
    if strands == 0 or total == 0:
        raise bad_file(subject, f"holds {strands} strands and {total} points", "export one with hair in it")
    if not flags & _POINTS:
        raise bad_file(subject, "holds no points", "export it with its points")
    at = _HEADER.size
    if flags & _SEGMENTS:
        if at + 2 * strands > len(content):
            raise bad_file(subject, f"{strands} strands do not fit its {len(content)} bytes", "it is truncated")
        counts = np.frombuffer(content, "<u2", strands, at).astype(np.int32) + 1
        at += 2 * strands
        held = int(counts.sum(dtype=np.int64))
    else:
        held = strands * (segments + 1)
    if held != total:
        raise bad_file(subject, f"its segments make {held} points but the header says {total}", "it is damaged")
    points = floats(content, at, 3 * total, subject, f"{total} points").reshape(-1, 3)
    if not flags & _SEGMENTS:  # only now: the points have shown that the file can hold this many strands
        counts = np.full(strands, segments + 1, np.int32)
    at += 12 * total
    widths = np.array([thickness], np.float32)
    if flags & _THICKNESS:
        widths = floats(content, at, total, subject, "thickness")
        at += 4 * total
    transparency = np.array([transparency], np.float32)
    if flags & _TRANSPARENCY:
        transparency = floats(content, at, total, subject, "transparency")
        at += 4 * total
    # In a header left at zero, black is not a colour that anybody chose.
    color = np.array([color], np.float32) if any(color) else None
    if flags & _COLOR:
        color = floats(content, at, 3 * total, subject, "colours").reshape(-1, 3)
    return RawGroom(points, counts, widths, color=color, transparency=transparency, up="Z")
