# SPDX-License-Identifier: Apache-2.0
"""Growing strands step by step: combed near the scalp, falling farther on, sliding over obstacles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from neuralocks_core.hairstyles.obstacle import Obstacle
from neuralocks_core.hairstyles.scalp import Roots, Scalp
from neuralocks_core.rotation import unit

DOWN = np.array([0.0, -1.0, 0.0])


@dataclass(eq=False)
class Site:
    """What a style may read about each root, scaled so that all heads look alike."""

    roots: Roots
    """Positions and normals."""
    seen: np.ndarray
    """(S, 3) position relative to the head's centre, in head radii: +X the left, +Y up, +Z the face."""
    guide: np.ndarray
    """(S,) int, the strand that leads the clump."""
    of_clump: np.ndarray
    """(S, 4) random numbers in 0..1, the same throughout a clump."""
    own: np.ndarray
    """(S, 4) random numbers in 0..1."""

    def rows(self, part: slice) -> Site:
        """Some of the strands; `guide` still counts all of them."""
        rest = (getattr(self, field)[part] for field in ("seen", "guide", "of_clump", "own"))
        return Site(self.roots.rows(part), *rest)

    def along_scalp(self, direction: np.ndarray) -> np.ndarray:
        """(S, 3) unit: a direction (S, 3) or (3,) projected onto the scalp."""
        normal = self.roots.normal
        direction = np.broadcast_to(direction, normal.shape)
        flat = direction - (direction * normal).sum(axis=1, keepdims=True) * normal
        return unit(flat + 1e-9 * DOWN)


@dataclass(eq=False)
class Plan:
    """How each strand grows; lengths in metres on a head of 0.1 m radius, scaled with the head."""

    length: np.ndarray
    """(S,)."""
    first: np.ndarray
    """(S, 3) unit direction at the root."""
    comb: np.ndarray
    """(S, 3) unit direction near the scalp."""
    comb_reach: np.ndarray
    """(S,) length over which the comb gives way to the fall."""
    fall: np.ndarray
    """(S, 3) direction farther on."""
    turn: np.ndarray
    """(S,) how fast it turns there [1/m]."""
    margin: np.ndarray
    """(S,) distance kept from skin once grown out; gives a style its volume."""
    side: np.ndarray
    """(S,) -1 or 1: which side of the face the strand keeps to; 0 may hang over the face."""
    cut: np.ndarray
    """(S,) height in head radii from the head's centre at which scissors cut; -inf for no cut."""

    def rows(self, part: slice) -> Plan:
        """Some of the strands."""
        return Plan(**{field: value[part] for field, value in vars(self).items()})


STEPS = 24
"""Vertices of a strand before it is waved or curled."""
CHUNK = 4096
"""Strands worked on at a time: their arrays stay in the processor's cache."""


def march(site: Site, plan: Plan, scalp: Scalp, obstacle: Obstacle) -> np.ndarray:
    """(S, STEPS, 3) float32 [m] strands from their roots, cut and evenly spaced."""
    points = np.empty((len(plan.length), STEPS, 3), np.float32)
    for start in range(0, len(points), CHUNK):
        part = slice(start, start + CHUNK)
        points[part] = _march(site.rows(part), plan.rows(part), scalp, obstacle)
    return points


def _march(site: Site, plan: Plan, scalp: Scalp, obstacle: Obstacle) -> np.ndarray:
    size = scalp.radius / 0.1
    length = plan.length * size
    step = length / (STEPS - 1)
    points = np.empty((len(length), STEPS, 3), np.float32)
    points[:, 0] = site.roots.place
    at, direction = site.roots.place.astype(np.float64), plan.first
    near = np.zeros(len(at), bool)
    front = np.where(site.seen[:, 2] > 0.30 + 0.25 * site.of_clump[:, 2], 1.0, -1.0)
    for vertex in range(1, STEPS):
        grown = step * vertex
        falls = smooth(grown / (plan.comb_reach * size))[:, None]
        target = unit(plan.comb * (1 - falls) + plan.fall * falls)
        rate = np.minimum(plan.turn * step / size, 1.0)[:, None]
        # Hair that stands straight up has no direction to fall in until its comb gives it one.
        stands = (direction * target).sum(axis=1, keepdims=True) < -0.6
        target = np.where(stands, unit(target + plan.comb), target)
        target = _past_shoulders(target, at, front, near, scalp)
        direction = unit(direction + rate * (target - direction))
        # Skin is soft-edged at the root, where the strand leaves it.
        margin = plan.margin * size * smooth(grown / (0.045 * size)) + 0.0015 * size * smooth(grown / (0.01 * size))
        ahead = at + step[:, None] * direction
        ahead = _beside_face(ahead, plan.side, grown / size, scalp)
        for _ in range(2):
            ahead = obstacle.push_out(ahead, margin)
            ahead = at + step[:, None] * unit(ahead - at)
        near = obstacle.distance(ahead)[0] < 0.35 * scalp.radius
        direction = unit(ahead - at)
        at = ahead
        points[:, vertex] = at
    return _cut(points, plan.cut * scalp.radius + scalp.head_centre[1])


def _beside_face(points: np.ndarray, side: np.ndarray, grown: np.ndarray, scalp: Scalp) -> np.ndarray:
    """Points pushed sideways out of an egg shape in front of the face, more the farther they have grown."""
    seen = (points - scalp.head_centre) / scalp.radius
    inside = 1.0 - ((seen[:, 1] + 0.55) / 1.25) ** 2 - ((seen[:, 2] - 1.15) / 0.95) ** 2
    half_width = 0.72 * np.sqrt(np.maximum(inside, 0.0)) * smooth((grown - 0.01) / 0.07)
    wanted = np.maximum(seen[:, 0] * side, half_width) * side
    seen[:, 0] = np.where((side != 0) & (half_width > 0), wanted, seen[:, 0])
    return scalp.head_centre + scalp.radius * seen


def _past_shoulders(
    target: np.ndarray, at: np.ndarray, front: np.ndarray, near: np.ndarray, scalp: Scalp
) -> np.ndarray:
    """Directions (S, 3) that lead long hair in front of or behind the shoulders instead of out over the arms."""
    seen = (at - scalp.head_centre) / scalp.radius
    low = smooth((-seen[:, 1] - 0.7) / 0.8)
    inward = -0.45 * np.sign(seen[:, 0]) * smooth((np.abs(seen[:, 0]) - 0.6) / 0.5)
    aside = 0.6 * front * near * smooth((np.abs(seen[:, 0]) - 0.3) / 0.3)
    return unit(target + low[:, None] * np.stack([inward, 0 * low, aside], axis=1))


def _cut(points: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Strands cut where they first sink below a height (S,) [m], evenly spaced again."""
    below = points[:, :, 1] < height[:, None]
    first = np.where(below.any(axis=1), below.argmax(axis=1), points.shape[1])
    cut = np.flatnonzero((first < points.shape[1]) & (first > 1))
    if not len(cut):
        return points
    last = first[cut]
    above, under = points[cut, last - 1, 1], points[cut, last, 1]
    share = np.clip((above - height[cut]) / np.maximum(above - under, 1e-9), 0.0, 1.0)
    end = last - 1 + share
    points[cut] = at_vertices(points[cut], end[:, None] * np.linspace(0.0, 1.0, points.shape[1]))
    return points


def at_vertices(points: np.ndarray, place: np.ndarray) -> np.ndarray:
    """(S, M, 3): points (S, K, 3) interpolated at fractional vertex numbers (S, M)."""
    vertex = np.clip(place.astype(np.int64), 0, points.shape[1] - 2)
    part = (place - vertex)[..., None].astype(points.dtype)
    rows = np.arange(len(points))[:, None]
    return points[rows, vertex] * (1 - part) + points[rows, vertex + 1] * part


def evenly(points: np.ndarray, count: int) -> np.ndarray:
    """(S, count, 3): strands (S, K, 3) evenly spaced in arc length."""
    step = np.linalg.norm(np.diff(points, axis=1), axis=2)
    arc = np.concatenate([np.zeros((len(points), 1)), np.cumsum(step, axis=1, dtype=np.float64)], axis=1)
    share = arc / np.maximum(arc[:, -1:], 1e-12)
    # All strands share one ascending key, so that one search serves them all.
    rows = np.arange(len(points))[:, None]
    wanted = np.linspace(0.0, 1.0, count)
    found = np.searchsorted((share + 2 * rows).ravel(), (wanted + 2 * rows).ravel(), side="right")
    before = np.clip(found.reshape(len(points), count) - rows * points.shape[1] - 1, 0, points.shape[1] - 2)
    low, high = np.take_along_axis(share, before, 1), np.take_along_axis(share, before + 1, 1)
    part = np.clip((wanted - low) / np.maximum(high - low, 1e-12), 0.0, 1.0)
    return at_vertices(points, before + np.minimum(part, 1 - 1e-7))


def smooth(x: np.ndarray) -> np.ndarray:
    """0 below 0, 1 above 1, smooth in between."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)
