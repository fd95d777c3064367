# SPDX-License-Identifier: Apache-2.0
"""A library of hairstyles that grow on any scalp."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from neuralocks_core.arguments import is_whole
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import Groom
from neuralocks_core.hairstyles import loose, tied
from neuralocks_core.hairstyles.growth import STEPS, Site, evenly
from neuralocks_core.hairstyles.obstacle import Obstacle
from neuralocks_core.hairstyles.scalp import Scalp, from_head
from neuralocks_core.hairstyles.shaping import shaped
from neuralocks_core.hairstyles.style import Style
from neuralocks_core.hairstyles.variation import Variation
from neuralocks_core.progress import Progress, silent, within
from neuralocks_core.strands.strand_set import root_uv

STYLES = {**loose.STYLES, **tied.STYLES}
"""The styles that `grow` knows, by name."""

MOST_STRANDS = 150_000

__all__ = ["MOST_STRANDS", "STYLES", "Obstacle", "Scalp", "check_style", "from_head", "grow"]

_ROOTS, _AXES = 80, 430
"""Progress in thousandths, for many strands, when their roots are placed, and when their axes are grown."""
_ROOT_WIDTH, _TIP_WIDTH, _HAIRS = 9e-5, 5e-5, 100_000
"""Widths of real hair [m], and the number of hairs on a head."""
_WIDEST = 10.0
"""Fewer strands are wider, at most this many times: as thin as hair, they would show the scalp in every renderer."""


def grow(
    style: str,
    scalp: Scalp,
    count: int,
    seed: int = 0,
    body: tuple[np.ndarray, np.ndarray] | Obstacle | None = None,
    variation: int = 0,
    progress: Progress | None = None,
) -> Groom:
    """Grow a hairstyle. On a scalp of 0.1 m radius, 100,000 strands are 0.09 mm wide at the root and 0.05 mm at the tip. Fewer are
    wider, by the square root of how many times fewer, up to ten times; and width goes with the scalp's radius.

    Args:
        style: one of `STYLES`.
        scalp: where hair grows, in bind space.
        count: how many strands, 1 to 150,000.
        seed: a whole number from 0 on; the same seed gives the same groom.
        body: points (V, 3) [m] and triangles (F, 3) that hair keeps out of, or an `Obstacle` made from them,
            which is worth keeping for several styles; without one, a typical head, neck and shoulders.
        variation: number of a variation of the style, with another cut, parting, waves and direction; 0 is the style itself.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: an unknown style, no scalp, or a count, seed or variation that is no whole number or out of range.
    """
    check_style(style, count, variation, seed)
    if not isinstance(scalp, Scalp):
        raise NeuralocksError(
            f"scalp: {scalp!r} is not one; give a Scalp, such as hairstyles.from_head marks on a head"
        )
    random = np.random.default_rng(seed)
    obstacle = body if isinstance(body, Obstacle) else Obstacle(scalp, body)
    size = scalp.radius / 0.1
    chosen, varied = STYLES[style], Variation.numbered(variation, style) if variation else None
    if varied:
        chosen = chosen.varied(varied)
    say = progress or silent
    say(0, 1000, "placing roots")
    site = _site(chosen, scalp, count, random, size)
    say(_ROOTS, 1000, "growing")
    axis = chosen.axis(site, scalp, obstacle)
    if varied:
        axis = varied.trimmed(axis, site)
    points = shaped(axis, site, chosen.shape, obstacle, size, within(say, _AXES, 1000))
    if varied:
        points = varied.pressed(points, obstacle, size)
    if chosen.shape.vertices == STEPS:
        points = evenly(points, STEPS).astype(np.float32)
        points[:, 0] = axis[:, 0]
    vertices = points.shape[1]
    wider = size * np.clip(np.sqrt(_HAIRS / count), 1.0, _WIDEST)
    width = np.linspace(wider * _ROOT_WIDTH, wider * _TIP_WIDTH, vertices, dtype=np.float32)
    guides = np.zeros(count, bool)
    guides[site.guide] = True
    return Groom(
        name=style,
        points=points.reshape(-1, 3),
        counts=np.full(count, vertices, np.int32),
        widths=np.tile(width, count),
        root_uv=root_uv(site.roots.place, scalp.head_centre),
        guides=guides,
    )


def check_style(style: str, count: int, variation: int = 0, seed: int = 0) -> None:
    """Refuse what `grow` cannot grow; it takes seconds to look at a head first.

    Raises:
        NeuralocksError: an unknown style, or a count, seed or variation that is no whole number or out of range.
    """
    if not isinstance(style, str) or style not in STYLES:
        raise NeuralocksError(f"style {style!r}: is unknown; use one of {', '.join(STYLES)}")
    if not is_whole(count, 1, MOST_STRANDS):
        raise NeuralocksError(
            f"style '{style}': cannot have {count!r} strands; give 1 to {MOST_STRANDS}, a whole number"
        )
    if not is_whole(variation, 0):
        raise NeuralocksError(f"style '{style}': there is no variation {variation!r}; give a whole number, 0 or more")
    if not is_whole(seed, 0):
        raise NeuralocksError(f"style '{style}': {seed!r} is no seed; give a whole number, 0 or more")


def _site(style: Style, scalp: Scalp, count: int, random: np.random.Generator, size: float) -> Site:
    roots = scalp.roots(count, random)
    if style.density is not None:
        many = scalp.roots(4 * count, random)
        chance = style.density((many.place - scalp.head_centre) / scalp.radius)
        kept = np.argsort(random.random(4 * count) / np.maximum(chance, 1e-6), kind="stable")[:count]
        roots = many.rows(kept)
    clumps = int(np.clip(scalp.area / (style.shape.clump_spacing * size) ** 2, 1, count))
    guides = np.arange(clumps)  # roots come in random order: the first ones are as good as any
    ragged = 0.15 * style.shape.clump_spacing * size * random.normal(size=(count, 3))
    seen = (roots.place - scalp.head_centre) / scalp.radius
    apart = np.zeros(count) if style.zone is None else 10.0 * style.zone(seen)  # farther than any search reaches [m]
    tree = cKDTree(np.column_stack([roots.place[guides], apart[guides]]))
    nearest = tree.query(np.column_stack([roots.place + ragged, apart]))[1]
    nearest[guides] = guides
    return Site(
        roots=roots,
        seen=seen,
        guide=guides[nearest],
        of_clump=random.random((clumps, 4))[nearest],
        own=random.random((count, 4)),
    )
