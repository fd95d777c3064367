# SPDX-License-Identifier: Apache-2.0
"""A small groom as a file of every format, and any groom as a .hair file."""

import struct

import numpy as np

from neuralocks_core.formats.look import Look

COUNTS = [4, 1, 3]
POINTS = np.random.default_rng(0).normal(size=(8, 3)).astype("<f4") * 0.1


def tressfx_text(points=POINTS, counts=COUNTS):
    lines = [
        "version 2.0",
        "scale 1.0",
        "rotation 0 0 0",
        "translation 0 0 0",
        f"numStrands {len(counts)}",
        "is sorted 1",
    ]
    at = 0
    for strand, n in enumerate(counts):
        lines.append(f"strand {strand} numVerts {n} texcoord 0.25 0.{strand}00000")
        lines += [" ".join(f"{float(v)!r}" for v in p) for p in points[at : at + n]]
        at += n
    return "\n".join(lines).encode()


def tressfx_v3():
    header = struct.pack("<fII", 3.0, 2, 4).ljust(144, b"\0") + struct.pack("<I", 304)  # not right after the header
    return header.ljust(304, b"\0") + POINTS.tobytes()


def tressfx_v4():
    header = struct.pack("<fIIIIII", 4.0, 2, 4, 160, 160 + 128, 0, 160 + 144).ljust(160, b"\0")
    uv = np.array([[0.1, 0.2], [0.3, 0.4]], "<f4")
    width = np.array([1e-4, 2e-4], "<f4")
    return header + np.c_[POINTS, np.ones(8, "<f4")].astype("<f4").tobytes() + uv.tobytes() + width.tobytes()


def hair():
    header = struct.pack("<4sIIIIfffff88s", b"HAIR", 3, 8, 3, 0, 1e-4, 0, 0, 0, 0, b"")
    return header + np.array([3, 0, 2], "<u2").tobytes() + POINTS.tobytes()


COLORS = np.random.default_rng(1).uniform(size=(8, 3)).astype("<f4")
CLEAR = np.random.default_rng(2).uniform(size=8).astype("<f4")


def hair_in_colors():
    header = struct.pack("<4sIIIIfffff88s", b"HAIR", 3, 8, 31, 0, 1e-4, 0.5, 0.1, 0.2, 0.3, b"")
    arrays = [POINTS, np.full(8, 1e-4, "<f4"), CLEAR, COLORS]
    return header + np.array([3, 0, 2], "<u2").tobytes() + b"".join(array.tobytes() for array in arrays)


def counted(columns, points=POINTS):
    parts, at = [struct.pack("<i", 3)], 0
    for n in COUNTS:
        rows = np.zeros((n, columns), "<f4")
        rows[:, :3] = points[at : at + n]
        parts += [struct.pack("<i", n), rows.tobytes()]
        at += n
    return b"".join(parts)


FILES = {
    "text.tfx": tressfx_text(),
    "v3.tfx": tressfx_v3(),
    "v4.tfx": tressfx_v4(),
    "a.hair": hair(),
    "colors.hair": hair_in_colors(),
    "a.data": counted(3),
    "a.bin": counted(7),
}


def write_hair(path, groom, unit=0.01, up="Z", look=None):
    """Write a groom, and its colours, as .hair: `unit` metres per unit of the file, whose upward axis is `up`."""
    look = look or Look(None, None)
    points, widths, scale = groom.points, groom.widths, np.float32(1.0 / unit)
    if up == "Z":
        points = np.stack([points[:, 0], -points[:, 2], points[:, 1]], axis=1)
    if len(widths) == groom.strand_count and len(widths) > 1:
        widths = np.repeat(widths, groom.counts)
    color = np.zeros((1, 3), np.float32) if look.color is None else look.color
    clear = np.zeros(1, np.float32) if look.opacity is None else 1 - look.opacity
    # Segments and points always; thickness, transparency and colours only if they are more than one number.
    each = [(flag, values) for flag, values in ((4, widths * scale), (8, clear), (16, color)) if len(values) > 1]
    flags, first = 3 + sum(flag for flag, _ in each), (float(widths[0] * scale), float(clear[0]), *color[0].tolist())
    header = struct.pack("<4sIIIIfffff88s", b"HAIR", groom.strand_count, len(points), flags, 0, *first, b"")
    blocks = [(groom.counts - 1).astype("<u2"), (points * scale).astype("<f4"), *(v.astype("<f4") for _, v in each)]
    path.write_bytes(header + b"".join(block.tobytes() for block in blocks))


def put(folder, name, content):
    path = folder / name
    path.write_bytes(content)
    return path
