# SPDX-License-Identifier: Apache-2.0
"""Hair that was made for another head, put on a scalp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from neuralocks_core.body.collider import Collider
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import Groom
from neuralocks_core.hairstyles.scalp import Scalp

FEWEST = 4
"""Roots that determine a sphere."""
OFF = 0.2
"""A root this far off the sphere, relative to its radius, such as that of a tail's hair tie, does not count."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """Hair on a scalp.

    Attributes:
        grooms: in the scalp's space [m].
        scale: how many times as large as it was the hair is now.
        moved: how far each strand was moved to bring its root onto the skin, (S,) [m].
    """

    grooms: list[Groom]
    scale: float
    moved: np.ndarray


def fit(grooms: Sequence[Groom], scalp: Scalp, skin: Collider, resize: bool = True) -> Fitted:
    """Put grooms of one head on another: the sphere through their roots onto the sphere through the scalp, then each strand as a whole
    so that its root lies on the skin.

    Args:
        grooms: upright, face +Z; their place does not matter.
        scalp: where hair grows.
        skin: the head's skin.
        resize: give the hair the scalp's size, too.

    Raises:
        NeuralocksError: too few roots, or all in one place.
    """
    roots = [each.points[each.starts[each.counts > 0]].astype(float) for each in grooms]
    if sum(map(len, roots)) < FEWEST:
        raise NeuralocksError(
            f"groom: has fewer than {FEWEST} strands, which do not tell where the head is; place it yourself"
        )
    every = np.concatenate(roots)
    if not np.ptp(every, axis=0).max() > 1e-6 * np.abs(every).max():
        raise NeuralocksError(
            "groom: all its roots are in one place, which does not tell where the head is; place it yourself"
        )
    centre, radius = sphere(every)
    middle, wanted = sphere(scalp.points[np.unique(scalp.triangles)])
    scale = wanted / radius if resize else 1.0
    found, moved = [], []
    for each, own in zip(grooms, roots):
        onto = np.zeros((each.strand_count, 3))
        placed = (own - centre) * scale + middle
        distance, normal = skin.distance(placed, limit=np.inf)
        onto[each.counts > 0] = -distance[:, None] * normal
        points = (each.points - centre) * scale + middle + np.repeat(onto, each.counts, axis=0)
        found.append(replace(each, points=points.astype(np.float32), widths=np.float32(scale) * each.widths))
        moved.append(np.abs(distance))
    return Fitted(found, scale, np.concatenate(moved))


def sphere(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre (3,) and radius of the sphere nearest to points (n, 3), in least squares, without those that are far off it."""
    used = points
    for _ in range(4):
        design = np.concatenate([2 * used, np.ones((len(used), 1))], axis=1)
        x = np.linalg.lstsq(design, np.square(used).sum(1), rcond=None)[0]
        centre, radius = x[:3], float(np.sqrt(x[3] + np.square(x[:3]).sum()))
        near = points[np.abs(np.linalg.norm(points - centre, axis=1) - radius) < OFF * radius]
        if len(near) < FEWEST:
            break
        used = near
    return centre, radius
