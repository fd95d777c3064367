# SPDX-License-Identifier: Apache-2.0
"""Binary TressFX files (AMD), versions 3 and 4: every strand has the same number of vertices."""

from __future__ import annotations

import struct

import numpy as np

from neuralocks_core.formats.raw import RawGroom, bad_file, big_endian, floats

HEADERS = {3: 296, 4: 160}
"""Bytes of the header of each version."""


def read(content: bytes, subject: str) -> RawGroom:
    """Parse a binary .tfx file.

    Version 4 stores float4 positions (the fourth is the inverse mass) at the byte offset held at byte 12; version 3 stores
    float3 at the one held at byte 144. An offset of 0 means right after the header. Version 4 may also hold a texture
    coordinate and a thickness for each strand.

    Args:
        content: the whole file.
        subject: what messages call it.

    Raises:
        NeuralocksError: it is truncated, of another version, or holds no strands.
    """
    if len(content) < 12:
        raise bad_file(subject, f"has {len(content)} bytes, fewer than a TressFX header", "it is truncated")
    version, strands, vertices = struct.unpack_from("<fII", content)
    if version not in HEADERS:
        if struct.unpack_from(">f", content)[0] in HEADERS:
            raise big_endian(subject)
        raise bad_file(subject, "is not TressFX text v2 or binary v3 or v4", "export it in one of these")
    header = HEADERS[int(version)]
    if len(content) < header:
        raise bad_file(subject, f"has {len(content)} bytes but the header has {header}", "it is truncated")
    if strands == 0 or vertices == 0:
        raise bad_file(subject, f"holds {strands} strands of {vertices} vertices", "export one with hair in it")

    components = 3 if version == 3 else 4
    (offset,) = struct.unpack_from("<I", content, 144 if version == 3 else 12)
    offset = _outside_header(offset or header, header, subject, "positions")
    total = strands * vertices
    points = floats(content, offset, total * components, subject, f"positions of {strands} x {vertices} vertices")
    points = points.reshape(total, components)[:, :3]

    root_uv = widths = None
    if version == 4:
        uv_at, _, thickness_at = struct.unpack_from("<III", content, 16)
        if uv_at:
            _outside_header(uv_at, header, subject, "strand texture coordinates")
            root_uv = floats(content, uv_at, 2 * strands, subject, "strand texture coordinates").reshape(-1, 2)
        if thickness_at:
            _outside_header(thickness_at, header, subject, "strand thickness")
            widths = floats(content, thickness_at, strands, subject, "strand thickness")
    return RawGroom(points, np.full(strands, vertices, np.int32), widths, root_uv)


def _outside_header(offset: int, header: int, subject: str, what: str) -> int:
    if offset < header:
        raise bad_file(subject, f"{what} are said to lie at byte {offset}, inside the header", "it is damaged")
    return offset
