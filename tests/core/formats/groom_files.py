# SPDX-License-Identifier: Apache-2.0
"""A small groom as a file of every format."""

import struct

import numpy as np

COUNTS = [4, 1, 3]
POINTS = np.random.default_rng(0).normal(size=(8, 3)).astype("<f4") * 0.1


def tressfx_text(points=POINTS, counts=COUNTS):
    lines = ["version 2.0", "scale 1.0", "rotation 0 0 0", "translation 0 0 0", "numStrands 3", "is sorted 1"]
    at = 0
    for strand, n in enumerate(counts):
        lines.append(f"strand {strand} numVerts {n} texcoord 0.25 0.{strand}00000")
        lines += [" ".join(f"{float(v)!r}" for v in p) for p in points[at : at + n]]
        at += n
    return "\n".join(lines).encode()


def tressfx_v3():
    header = struct.pack("<fII", 3.0, 2, 4).ljust(144, b"\0") + struct.pack("<I", 296)
    return header.ljust(296, b"\0") + POINTS.tobytes()


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


def counted(columns):
    parts, at = [struct.pack("<i", 3)], 0
    for n in COUNTS:
        rows = np.zeros((n, columns), "<f4")
        rows[:, :3] = POINTS[at : at + n]
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


def put(folder, name, content):
    path = folder / name
    path.write_bytes(content)
    return path
