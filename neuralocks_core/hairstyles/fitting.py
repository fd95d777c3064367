# SPDX-License-Identifier: Apache-2.0
"""Hair that was made for another head, put on a scalp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from neuralocks_core.body.collider import Collider
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import WIDTH, Groom
from neuralocks_core.hairstyles.scalp import Scalp
from neuralocks_core.rotation import unit

FEWEST = 4
"""Roots that determine a sphere."""
OFF = 0.2
"""A root this far off the sphere, relative to its radius, such as that of a tail's hair tie, does not count."""
DOUBT = 0.12
"""Largest share by which the radius of a head may be in doubt: whole heads of hair have 0.05 to 0.09, fringes and tails 0.2."""

ASIDE = 0.35
"""A root in a direction from the middle of the head that is this far from all directions of the scalp [rad] does not count, such as
a beard's.
"""
ROUNDS = 5
"""How often it is asked which roots count."""
AWAY = 0.2
"""A root this far from the scalp, relative to the head's radius, is not on it."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """Hair on a scalp.

    Attributes:
        grooms: in the scalp's space [m].
        scale: how many times as large as it was the hair is now.
        moved: how far each strand with vertices was moved to bring its root onto the skin, (S,) [m].
        off: the share of each groom's roots that are not on the scalp.
    """

    grooms: list[Groom]
    scale: float
    moved: np.ndarray
    off: list[float]


def fit(grooms: Sequence[Groom], scalp: Scalp, skin: Collider, resize: bool = True) -> Fitted:
    """Put grooms of one head on another: the sphere through their roots onto the sphere through the scalp, then each strand as a whole
    so that its root lies on the skin.

    Args:
        grooms: upright, face +Z; their place does not matter.
        scalp: where hair grows.
        skin: the head's skin.
        resize: give the hair the scalp's size, too.

    Raises:
        NeuralocksError: the roots are too few, in one place, or, to resize them, on too small a part of a head.
    """
    roots = [each.points[each.starts[each.counts > 0]].astype(float) for each in grooms]
    every = np.concatenate(roots)
    if len(every) < FEWEST:
        raise NeuralocksError(
            f"groom: has fewer than {FEWEST} strands, which do not tell where the head is; place it yourself"
        )
    if not np.ptp(every, axis=0).max() > 1e-6 * np.abs(every).max():
        raise NeuralocksError(
            "groom: all its roots are in one place, which does not tell where the head is; place it yourself"
        )
    on_scalp = scalp.points[np.unique(scalp.triangles)]
    middle, wanted = sphere(on_scalp)
    used, centre, radius = _head(every, on_scalp - middle, None if resize else wanted)
    if resize and not _doubt(used, centre, radius) <= DOUBT:
        raise NeuralocksError(
            "groom: its roots are on too small a part of a head to tell how large that is; import it together with the other "
            "parts of that hair, or give --unit; if its strands run from tip to root, reverse them"
        )
    scale, found, moved, off = wanted / radius, [], [], []
    hairy = Collider(scalp.points, scalp.triangles)
    for each, own in zip(grooms, roots):
        onto = np.zeros((each.strand_count, 3))
        own = (own - centre) * scale + middle
        distance, normal = skin.distance(own, limit=np.inf)
        onto[each.counts > 0] = -distance[:, None] * normal
        far = np.abs(hairy.distance(own - distance[:, None] * normal, limit=np.inf)[0])
        off.append(float(np.mean(far > AWAY * wanted)) if len(own) else 0.0)
        points = (each.points - centre) * scale + middle + np.repeat(onto, each.counts, axis=0)
        found.append(replace(each, points=points.astype(np.float32), widths=sized(each.widths, scale)))
        moved.append(np.abs(distance))
    return Fitted(found, scale, np.concatenate(moved), off)


def sized(widths: np.ndarray, scale: float) -> np.ndarray:
    """Widths of hair that is made `scale` times as large. A thickness that no file stated is that of hair, whatever the head's size."""
    return widths if (widths == WIDTH).all() else np.float32(scale) * widths


def _head(roots: np.ndarray, scalp: np.ndarray, radius: float | None) -> tuple[np.ndarray, np.ndarray, float]:
    """The roots (n, 3) that tell where the head is, and the centre (3,) and radius of the sphere through them.

    They are all, or, if these suffice, those that lie in a direction of the scalp: a beard's are far from the skull's sphere.

    Args:
        roots: (N, 3).
        scalp: points (V, 3) relative to the middle of the head.
        radius: the sphere's, if it is known.
    """
    ways = cKDTree(unit(scalp))
    found = used, centre, size = roots, *_sphere(roots, radius)
    for _ in range(ROUNDS):
        over = roots[ways.query(unit(roots - centre))[0] < ASIDE]
        if len(over) < FEWEST or len(over) == len(used):
            break
        used, (centre, size) = over, _sphere(over, radius)
        if _doubt(used, centre, size) > DOUBT:
            break
        found = used, centre, size
    return found


def _sphere(points: np.ndarray, radius: float | None) -> tuple[np.ndarray, float]:
    centre, found = sphere(points)
    return (centre, found) if radius is None else (_of_radius(points, centre, radius), radius)


def sphere(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre (3,) and radius of the sphere nearest to points (n, 3), in least squares, without those that are far off it."""
    used = points
    for _ in range(4):
        design = np.concatenate([2 * used, np.ones((len(used), 1))], axis=1)
        x = np.linalg.lstsq(design, np.square(used).sum(1), rcond=None)[0]
        centre, radius = x[:3], float(np.sqrt(max(x[3] + np.square(x[:3]).sum(), 0.0)))
        near = _near(points, centre, radius)
        if near.sum() < FEWEST:
            break
        used = points[near]
    return centre, radius


def _near(points: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
    return np.abs(np.linalg.norm(points - centre, axis=1) - radius) < OFF * radius


def _doubt(points: np.ndarray, centre: np.ndarray, radius: float) -> float:
    """By which share the radius might differ, if all points were off the sphere in the worst way, as far as they are on average, and
    at least by a hundredth of the radius.
    """
    apart = (points - centre)[_near(points, centre, radius)]
    far = np.linalg.norm(apart, axis=1)
    if len(far) < FEWEST:
        return np.inf
    slopes = np.concatenate([apart / far[:, None], np.ones((len(far), 1))], axis=1)
    off = max(np.sqrt(np.square(far - radius).mean()) / radius, 0.01)
    return float(np.sqrt(np.linalg.inv(slopes.T @ slopes / len(far) + 1e-12 * np.eye(4))[3, 3]) * off)


def _of_radius(points: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
    """Centre (3,) of the sphere of a known radius that is nearest to points (n, 3), searched from a centre by Gauss-Newton steps."""
    for _ in range(30):
        apart = points - centre
        far = np.maximum(np.linalg.norm(apart, axis=1), 1e-12)
        near = np.abs(far - radius) < OFF * radius
        used = near if near.sum() >= FEWEST else slice(None)
        step = np.linalg.lstsq(apart[used] / far[used, None], (far - radius)[used], rcond=None)[0]
        centre = centre + step
    return centre
