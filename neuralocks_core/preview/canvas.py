# SPDX-License-Identifier: Apache-2.0
"""Draws coloured triangles and lines to an image, without a display."""

from dataclasses import replace

from neuralocks_core.preview.plain_canvas import PlainCanvas


def open_canvas(width, height, triangles, strands, detail):
    """The best canvas that works here, for this many strands of `detail.vertices` points (see `film.Detail`)."""
    try:
        from neuralocks_core.preview.gl_canvas import GlCanvas

        return GlCanvas(width, height, triangles, strands, detail)
    except Exception:  # a missing wheel, library or driver each raises something of its own
        # One step coarser; otherwise a clip of ten seconds would take minutes.
        coarser = replace(detail, scale=max(detail.scale - 1, 1), width=max(detail.width - 1, 1))
        return PlainCanvas(width, height, triangles, strands, coarser)
