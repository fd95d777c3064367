# SPDX-License-Identifier: Apache-2.0
"""Cem Yuksel's `.hair` files: reading and writing."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import atomic_write
from neuralocks_core.formats.look import Look
from neuralocks_core.formats.raw import RawGroom, bad_file, floats
from neuralocks_core.groom import Groom

_SEGMENTS, _POINTS, _THICKNESS, _TRANSPARENCY, _COLOR = 1, 2, 4, 8, 16
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
    if not flags & _SEGMENTS:  # only now, as the points have shown that so many strands fit the file
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
    # Of a header that was left at zero, black is no colour that somebody chose.
    color = np.array([color], np.float32) if any(color) else None
    if flags & _COLOR:
        color = floats(content, at, 3 * total, subject, "colours").reshape(-1, 3)
    return RawGroom(points, counts, widths, color=color, transparency=transparency, up="Z")


def write(path: str | Path, groom: Groom, unit: float = 0.01, up: str = "Z", look: Look | None = None) -> None:
    """Write a groom as .hair, under its final name only when complete.

    Args:
        path: the file.
        groom: strands of 1 to 65,536 vertices.
        unit: metres per unit of the file.
        up: "Y" or "Z", the file's upward axis.
        look: its colours.

    Raises:
        NeuralocksError: a strand does not fit the format, or the file cannot be written.
    """
    path = Path(path)
    if groom.counts.min() < 1 or groom.counts.max() > 65536:
        fact = f"a strand has {groom.counts.min()} or {groom.counts.max()} vertices"
        raise NeuralocksError(f"{groom.name}: {fact}; .hair holds 1 to 65536 a strand")
    points = groom.points
    if up == "Z":
        points = np.stack([points[:, 0], -points[:, 2], points[:, 1]], axis=1)
    widths = groom.widths
    if len(widths) == groom.strand_count and len(widths) > 1:
        widths = np.repeat(widths, groom.counts)
    scale = np.float32(1.0 / unit)
    color = np.zeros((1, 3), np.float32) if look is None or look.color is None else look.color
    clear = np.zeros(1, np.float32) if look is None or look.opacity is None else 1 - look.opacity
    of_points = ((_THICKNESS, widths * scale), (_TRANSPARENCY, clear), (_COLOR, color))
    each = [(flag, values) for flag, values in of_points if len(values) > 1]
    header = _HEADER.pack(
        b"HAIR",
        groom.strand_count,
        len(points),
        sum((flag for flag, _ in each), _SEGMENTS | _POINTS),
        0,
        float(widths[0] * scale),
        float(clear[0]),
        *color[0].tolist(),
        b"neuralocks",
    )
    blocks = [header, (groom.counts - 1).astype("<u2").tobytes(), (points * scale).astype("<f4").tobytes()]
    blocks += [values.astype("<f4").tobytes() for _, values in each]
    with atomic_write(path) as part, open(part, "wb") as file:
        file.writelines(blocks)
