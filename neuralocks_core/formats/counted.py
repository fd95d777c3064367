# SPDX-License-Identifier: Apache-2.0
"""USC-HairSalon `.data` and CT2Hair `.bin`: the number of strands, then each strand with its number of vertices."""

from __future__ import annotations

import numpy as np

from neuralocks_core.formats.raw import RawGroom, bad_file, big_endian


def read_hairsalon(content: bytes, subject: str) -> RawGroom:
    """USC-HairSalon (Hu et al. 2015): x y z per vertex, metres, Y up. Strands of one vertex have no hair.

    Args:
        content: the whole file.
        subject: what messages call it.
    """
    return _read(content, subject, components=3, unit=1.0)


def read_ct2hair(content: bytes, subject: str) -> RawGroom:
    """CT2Hair (Shen et al. 2023): x y z in millimetres, normal and label per vertex; Y up.

    Args:
        content: the whole file.
        subject: what messages call it.
    """
    return _read(content, subject, components=7, unit=0.001)


def _read(content: bytes, subject: str, components: int, unit: float) -> RawGroom:
    words = np.frombuffer(content, "<i4", len(content) // 4)
    if not len(words):
        raise bad_file(subject, f"has {len(content)} bytes, fewer than its number of strands", "it is truncated")
    strands = int(words[0])
    if not 0 < strands < len(words) and _fits(words[:2].byteswap(), components, len(words)):
        raise big_endian(subject)
    if strands <= 0:
        raise bad_file(subject, f"says that it holds {strands} strands", "export one with hair in it")
    if strands >= len(words):
        raise bad_file(
            subject,
            f"says that it holds {strands} strands, too many for {len(content)} bytes",
            "it is truncated",
        )
    counts = _counts(words, strands, components, subject)
    # Everything but the first word and the strands' counts is vertices.
    ends = 1 + np.cumsum(1 + counts.astype(np.int64) * components)
    vertices = np.ones(ends[-1], np.bool_)
    vertices[0] = False
    vertices[ends - 1 - counts.astype(np.int64) * components] = False
    values = words[: ends[-1]].view("<f4")[vertices].reshape(-1, components)
    left = len(content) - 4 * int(ends[-1])
    notes = [f"{subject}: {left} bytes after the last strand were not read"] if left else []
    return RawGroom(values[:, :3], counts, unit=unit, notes=notes)


def _fits(begin: np.ndarray, components: int, words: int) -> bool:
    """Whether a file of this many words may begin with these two numbers, of strands and of the first one's vertices."""
    return len(begin) == 2 and 0 < int(begin[0]) < words and 0 <= int(begin[1]) * components <= words


def _counts(words: np.ndarray, strands: int, components: int, subject: str) -> np.ndarray:
    """(S,) int32 vertices of each strand; each count follows directly after the strand before."""
    first = int(words[1])
    stride = 1 + first * components
    if 0 <= first and 1 + strands * stride <= len(words):
        equal = words[1 : 1 + strands * stride : stride]
        if (equal == first).all():
            return equal.astype(np.int32)
    counts = np.empty(strands, np.int32)
    at, end = 1, len(words)
    for strand in range(strands):
        if at >= end:
            raise bad_file(subject, f"ends before strand {strand} of {strands}", "it is truncated")
        count = int(words[at])
        at += 1 + count * components
        if count < 0 or at > end:
            fact = f"strand {strand} of {strands} says that it has {count} vertices, more than the file holds"
            raise bad_file(subject, fact if count >= 0 else fact.split(",")[0], "it is truncated or damaged")
        counts[strand] = count
    return counts
