# SPDX-License-Identifier: Apache-2.0
"""The skin that hair grows from, and where its roots are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from neuralocks_core.character import HEAD_WIDTHS
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.mesh import across, vertex_normals, welded_vertices
from neuralocks_core.rotation import unit

# The hairline seen from the side: (forward, up). Forward is -1 at the back of the skull and 1 at the
# forehead, up is in skull heights from the head's centre. It goes from the nape behind and over the ear and the
# sideburn to the forehead; read off a statistical head, at least plausible on others.
_HAIRLINE = np.array(
    [
        *[(-1.0, -0.85), (-0.42, -0.80), (-0.22, -0.46)],
        *[(-0.17, 0.02), (0.155, 0.03)],
        *[(0.20, -0.14), (0.38, -0.10)],
        *[(0.52, 0.23), (0.71, 0.47), (0.91, 0.54), (1.1, 0.56)],
    ]
)


@dataclass(frozen=True, eq=False)
class Scalp:
    """Triangles that carry hair, in bind space: metres, Y up, face +Z."""

    points: np.ndarray
    """(V, 3) float64 [m]; may be the whole body's; only the triangles count."""
    triangles: np.ndarray
    """(F, 3) int, outward."""
    head_centre: np.ndarray
    """(3,) float64 [m], middle of the skull, in bind space too: `Character.head_centre` is in canonical space."""

    def __post_init__(self) -> None:
        points = np.asarray(self.points, np.float64)
        triangles = np.asarray(self.triangles)
        centre = np.asarray(self.head_centre, np.float64)
        if points.ndim != 2 or points.shape[1] != 3 or triangles.ndim != 2 or triangles.shape[1] != 3:
            raise NeuralocksError("scalp: is not points (V, 3) and triangles (F, 3); give a triangle mesh")
        if not len(triangles) or triangles.min() < 0 or triangles.max() >= len(points):
            raise NeuralocksError("scalp: has no triangles or names points that are not there; mark the scalp again")
        if not np.isfinite(points[triangles]).all() or centre.shape != (3,) or not np.isfinite(centre).all():
            raise NeuralocksError("scalp: its points or its centre are not finite; repair the mesh")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "triangles", triangles.astype(np.int64))
        object.__setattr__(self, "head_centre", centre)
        if not self.area > 1e-6:
            raise NeuralocksError(f"scalp: its area is {self.area:g} m^2; mark a larger one or check the unit")

    @cached_property
    def area(self) -> float:
        """[m^2]."""
        return float(self._areas.sum())

    @cached_property
    def radius(self) -> float:
        """Size of the head [m]: mean distance of the scalp from the head's centre, about 0.1 for an adult."""
        middle = self.points[self.triangles].mean(axis=1)
        distance = np.linalg.norm(middle - self.head_centre, axis=1)
        return float(np.average(distance, weights=self._areas))

    @cached_property
    def _areas(self) -> np.ndarray:
        return np.linalg.norm(across(self.points[self.triangles]), axis=1) / 2

    def roots(self, count: int, random: np.random.Generator) -> Roots:
        """`count` roots spread evenly over the scalp, thinning out towards its border.

        Args:
            count: how many.
            random: source of the random positions.
        """
        areas = self._areas
        corners = self.points[self.triangles]
        # One draw in each of equally large pieces of area is much more even than independent draws.
        at = (np.arange(2 * count) + random.random(2 * count)) / (2 * count) * areas.sum()
        triangle = np.minimum(np.searchsorted(np.cumsum(areas), at), len(areas) - 1)
        u, v = random.random((2, len(triangle)))
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        weight = np.stack([1 - u - v, u, v], axis=1)
        place = np.einsum("nc,nci->ni", weight, corners[triangle])
        # A real hairline is soft: hair thins out over its last centimetre, and does not show the mesh's corners.
        border = self._border_distance(place) / (0.1 * self.radius)
        chance = np.clip(0.15 + border, 0.0, 1.0) * self._surrounded(place)
        order = np.argsort(random.random(len(place)) / np.maximum(chance, 1e-6), kind="stable")[:count]
        order.sort()
        order = random.permutation(order)
        normals = vertex_normals(self.points, self.triangles)[self.triangles[triangle[order]]]
        normal = unit(np.einsum("nc,nci->ni", weight[order], normals))
        return Roots(place[order], normal, border[order] * 0.1 * self.radius)

    def _border_distance(self, places: np.ndarray) -> np.ndarray:
        """(N,) distance [m] to the scalp's edge; large if it has none."""
        # Files split a skin along texture seams, where hair grows as elsewhere.
        first, place = welded_vertices(self.points)
        triangles = first[place][self.triangles]
        edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]))
        edge, uses = np.unique(edges, axis=0, return_counts=True)
        edge = edge[(uses == 1) & (edge[:, 0] < edge[:, 1])]
        if not len(edge):
            return np.full(len(places), np.inf)
        share = np.linspace(0.0, 1.0, 8)[:, None, None]
        line = (self.points[edge[:, 0]] * (1 - share) + self.points[edge[:, 1]] * share).reshape(-1, 3)
        return cKDTree(line).query(places)[0]

    def _surrounded(self, places: np.ndarray) -> np.ndarray:
        """(N,) 0..1: less where the scalp fills less than half of the neighbourhood, as on the corners of its edge."""
        every = places[:: max(1, len(places) // 5000)]
        if len(every) < 500:
            return np.ones(len(places))
        reach = 0.13 * self.radius
        near = cKDTree(every).query_ball_point(places, reach, return_length=True)
        filled = near * self.area / len(every) / (np.pi * reach**2)
        return np.clip((filled - 0.38) / 0.2, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Roots:
    """Where strands begin."""

    place: np.ndarray
    """(S, 3) [m]."""
    normal: np.ndarray
    """(S, 3) unit, out of the skin."""
    border: np.ndarray
    """(S,) distance to the hairline [m]."""

    def rows(self, index: slice | np.ndarray) -> Roots:
        """Some of the roots."""
        return Roots(self.place[index], self.normal[index], self.border[index])


def from_head(points: np.ndarray, triangles: np.ndarray, head_centre: np.ndarray, size: float = 1.0) -> Scalp:
    """Mark a plausible scalp on a head: above the hairline, the crown and the back down to the nape.

    Args:
        points: (V, 3) [m], bind space, Y up, face +Z; of the head or the whole body.
        triangles: (F, 3) int, outward.
        head_centre: (3,) [m], middle of the skull, in bind space: that of a character is
            `transformed(character.head_centre, character.canonical_to_bind)`.
        size: about how many times a person's size a giant is, `Character.times_human`.

    Raises:
        NeuralocksError: no part of the mesh is where a scalp would be, or the centre is not that of a head of this size.
    """
    points = np.asarray(points, np.float64)
    triangles = np.asarray(triangles, np.int64)
    head_centre = np.asarray(head_centre, np.float64)
    corners = points[triangles]
    a, b, c = corners.swapaxes(0, 1)
    middle = (a + b + c) / 3 - head_centre
    # The skull's radius: up from its centre, where there is nothing but skull.
    above = (np.hypot(middle[:, 0], middle[:, 2]) < 0.06 * size) & (middle[:, 1] > 0)
    if not above.any():
        raise NeuralocksError(
            "scalp: no mesh lies above the head's centre; choose another head joint, or give the body with its head"
        )
    radius = float(middle[above, 1].max())
    if radius > HEAD_WIDTHS[1] * size:  # as if a canonical centre, which is near the origin, were one in bind space
        raise NeuralocksError(
            f"scalp: the mesh reaches {radius:.2g} m above the head's centre, too far for a head; choose another head joint, or "
            "give head_centre in bind space, and the size of a giant"
        )
    seen = middle / radius
    skull = seen[(seen[:, 1] > 0.35) & (np.linalg.norm(seen, axis=1) < 1.5)]
    back, front = skull[:, 2].min(), skull[:, 2].max()
    forward = (2 * seen[:, 2] - front - back) / max(front - back, 1e-9)
    up = np.interp(forward, _HAIRLINE[:, 0], _HAIRLINE[:, 1])
    outward = (across(corners) * middle).sum(axis=1) > 0
    # Ears stick out sideways below the hairline's arch; the eyeballs and the mouth lie too deep.
    size = np.linalg.norm(seen, axis=1)
    ear = (np.abs(seen[:, 0]) > 0.78) & (seen[:, 1] < 0.05)
    chosen = (seen[:, 1] > up) & outward & (size > 0.6) & (size < 1.5) & ~ear
    if not chosen.any():
        raise NeuralocksError(
            "scalp: nothing of the mesh lies above the hairline; choose another head joint, or give the body with its head"
        )
    return Scalp(points, triangles[chosen], head_centre)
