# SPDX-License-Identifier: Apache-2.0
"""Text TressFX files (AMD), version 2: a header of keys, then strands of any vertex counts."""

from __future__ import annotations

import codecs
import io
import re
from array import array

import numpy as np

from neuralocks_core.formats.raw import RawGroom, bad_file

_HEADER_LINES = 1000
_BEGINNING = re.compile(rb"(?:\xef\xbb\xbf)?(?:\s|#[^\n]*\n)*version", re.IGNORECASE)
"""The version, after an optional byte order mark, blank lines and comments."""


def recognised(content: bytes) -> bool:
    """Whether a file begins like one of this format."""
    return _BEGINNING.match(content[: 1 << 16]) is not None


def read(content: bytes, subject: str) -> RawGroom:
    """Parse a version 2 .tfx file.

    The header's scale, rotation (degrees about X, then Y, then Z) and translation are applied.

    Args:
        content: the whole file.
        subject: what messages call it.

    Raises:
        NeuralocksError: it is truncated, of another version, malformed, or holds no strands.
    """
    lines = enumerate(io.BytesIO(content.removeprefix(codecs.BOM_UTF8)), start=1)
    keys, *first = _header(lines, subject)
    points, counts, uv = _strands(lines, *first, subject)
    notes = []
    declared = (keys.get(b"numStrands") or [len(counts)])[0]
    if declared > len(counts):
        fact = f"its header says {declared:g} strands, it holds {len(counts)}"
        raise bad_file(subject, fact, "it is truncated: export it again")
    if declared < len(counts):
        notes.append(f"{subject}: its header says {declared:g} strands, it holds {len(counts)}")
    root_uv = np.frombuffer(uv, np.float32).reshape(-1, 2)
    if not root_uv.any() or np.isnan(root_uv).any():
        root_uv = None  # exporters without texture coordinates write zeros
    placed = _placed(np.frombuffer(points, np.float32).reshape(-1, 3), keys)
    return RawGroom(placed, np.frombuffer(counts, np.int32), None, root_uv, notes=notes)


def _strands(lines, number: int, line: bytes, subject: str) -> tuple[array, array, array]:
    """Coordinates of all vertices, vertices of each strand, and texture coordinates of each, NaN if it has none; from this line on."""
    # Line by line into plain arrays: the numbers of a hostile file never become millions of Python objects.
    points, counts, uv = array("f"), array("i"), array("f")
    left = 0
    while line:
        # Exporters of ZBrush curves put commas between the coordinates.
        words = (line.replace(b",", b" ") if left else line).split(None, 6)
        if not words or words[0].startswith(b"#"):
            pass
        elif left and len(words) == 3:
            points.extend(_numbers(words, subject, number))
            left -= 1
        elif left:
            raise bad_file(subject, f"line {number} is not x y z; strand {len(counts) - 1} lacks {left} vertices")
        elif words[0] == b"strand" and len(words) >= 4 and words[2] == b"numVerts":
            left = _count(words[3], subject, number)
            counts.append(left)
            coordinate = (
                words[5].split() + words[6].split(None, 2) if len(words) == 7 and words[4] == b"texcoord" else []
            )
            uv.extend(_numbers(coordinate, subject, number) if len(coordinate) == 2 else (np.nan, np.nan))
        else:
            raise bad_file(subject, f"line {number} is neither a strand nor x y z")
        number, line = next(lines, (number, b""))
    if left:
        raise bad_file(subject, f"ends {left} vertices before strand {len(counts) - 1} does", "it is truncated")
    if not counts:
        raise bad_file(subject, "holds no strands", "export one with hair in it")
    return points, counts, uv


def _header(lines, subject: str) -> tuple[dict[bytes, list[float]], int, bytes]:
    """The header's numbers by key, and the number and text of the first line after it."""
    keys: dict[bytes, list[float]] = {}
    for number, line in lines:
        words = line.split(None, 8)
        if words and words[0] == b"strand":
            break
        if words[:2] == [b"is", b"sorted"]:
            number, line = next(lines, (number, b""))
            break
        if number > _HEADER_LINES:
            raise bad_file(subject, f"no strand begins within {_HEADER_LINES} lines", "give a TressFX file")
        if words and not words[0].startswith(b"#"):
            keys[bytes(words[0][:64])] = _numbers(words[1:4], subject, number)
    else:
        return keys, 0, b""
    if keys.get(b"version", [2.0])[:1] != [2.0]:
        raise bad_file(subject, "is not version 2 of the text format", "export it as TressFX 2, 3 or 4")
    return keys, number, line


def _numbers(words: list[bytes], subject: str, number: int) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError:
        raise bad_file(subject, f"line {number} does not hold numbers") from None
    if any(not -3e38 < value < 3e38 for value in values):
        raise bad_file(subject, f"line {number} holds a number that is not finite", "repair it")
    return values


def _count(word: bytes, subject: str, number: int) -> int:
    # Nine digits fit in 32 bits; a file that claims more than it holds is refused at its end.
    if not (word.isdigit() and len(word) <= 9):
        raise bad_file(subject, f"line {number} does not give a number of vertices")
    return int(word)


@np.errstate(over="ignore", invalid="ignore")  # whoever reads the file refuses points that are not finite
def _placed(points: np.ndarray, keys: dict[bytes, list[float]]) -> np.ndarray:
    scale = (keys.get(b"scale") or [1.0])[0]
    angles = keys.get(b"rotation") or []
    shift = keys.get(b"translation") or []
    if scale != 1.0:
        points = points * scale
    if len(angles) == 3 and any(angles):
        for axis, angle in enumerate(np.radians(angles)):
            turn, (a, b) = np.eye(3), ((axis + 1) % 3, (axis + 2) % 3)
            turn[a, a] = turn[b, b] = np.cos(angle)
            turn[b, a], turn[a, b] = np.sin(angle), -np.sin(angle)
            points = points @ turn.T
    if len(shift) == 3 and any(shift):
        points = points + shift
    return points
