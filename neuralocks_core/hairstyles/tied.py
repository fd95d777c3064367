# SPDX-License-Identifier: Apache-2.0
"""Styles tied in one place: hair runs tightly over the head to the tie, and onwards from there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from neuralocks_core.hairstyles.growth import DOWN, Site, at_vertices, evenly, smooth
from neuralocks_core.hairstyles.obstacle import Obstacle
from neuralocks_core.hairstyles.scalp import Scalp
from neuralocks_core.hairstyles.shaping import Shape
from neuralocks_core.hairstyles.style import Style
from neuralocks_core.hairstyles.variation import Variation
from neuralocks_core.rotation import unit

_ON_HEAD, _TAIL = 18, 60


@dataclass(frozen=True)
class Tied(Style):
    """A style that gathers hair in one place: where it is tied, and how the hair continues behind the tie."""

    tie: tuple[float, float, float]
    """Direction of the tie from the head's centre."""
    tail: Callable[[Site, Knot, Scalp, Obstacle], np.ndarray]
    """Points (S, M, 3) [m] behind the tie; all are called with the same arguments, though a bun ignores the obstacle."""

    def axis(self, site: Site, scalp: Scalp, obstacle: Obstacle) -> np.ndarray:
        """From the roots over the head, through the tie and on."""
        knot = _knot(site, self.tie, scalp, obstacle)
        ring = knot.place + 0.11 * scalp.radius * (knot.disc @ np.stack(_across(knot.out)))
        head = _over_head(site, ring, scalp, obstacle)
        points = np.concatenate([head[:, :-1], self.tail(site, knot, scalp, obstacle)], axis=1)
        for _ in range(4):  # round the corner at the tie
            points[:, 1:-1] = (points[:, :-2] + 2 * points[:, 1:-1] + points[:, 2:]) / 4
        return evenly(points.astype(np.float32), self.shape.vertices)

    def varied(self, variation: Variation) -> Tied:
        tie = tuple(float(a + b) for a, b in zip(self.tie, variation.tie, strict=True))
        return replace(self, shape=variation.of_shape(self.shape), tie=tie)


@dataclass(frozen=True, eq=False)
class Knot:
    """The tie on one head."""

    place: np.ndarray
    """(3,) [m]."""
    out: np.ndarray
    """(3,) unit, out of the head."""
    disc: np.ndarray
    """(S, 2) position of each strand in the tied bundle, in a unit disc; neighbours on the scalp are neighbours in it."""


def _knot(site: Site, tie: tuple[float, float, float], scalp: Scalp, obstacle: Obstacle) -> Knot:
    out = unit(np.array(tie))
    # From far outside back to the skin, then out by the bundle's own thickness.
    place = scalp.head_centre + 1.6 * scalp.radius * out
    for _ in range(12):
        distance, _ = obstacle.distance(place[None])
        place = place - (distance[0] - 0.10 * scalp.radius) * out
    e1, e2 = _across(out)
    bearing = np.arctan2(site.seen @ e2, site.seen @ e1)
    far = np.sqrt(site.own[:, 0])
    return Knot(place, out, np.stack([far * np.cos(bearing), far * np.sin(bearing)], axis=1))


def _across(out: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    e1 = unit(np.cross([0.0, 1.0, 0.0], out))
    return e1, np.cross(out, e1)


def _over_head(site: Site, ring: np.ndarray, scalp: Scalp, obstacle: Obstacle) -> np.ndarray:
    """(S, _ON_HEAD, 3) the shortest path over the head from each root to its place in the tie."""
    start, end = site.roots.place - scalp.head_centre, ring - scalp.head_centre
    high, far = np.linalg.norm(start, axis=1), np.linalg.norm(end, axis=1)
    a, b = unit(start), unit(end)
    angle = np.arccos(np.clip((a * b).sum(axis=1), -1.0, 1.0))[:, None]
    share = np.linspace(0.0, 1.0, _ON_HEAD)
    # From far round the head the shortest path is ambiguous, or crosses the face: such hair goes by the temples.
    far_round = smooth((angle - 1.2) / 0.7)[..., None] * np.sin(np.pi * share)[None, :, None]
    x = site.seen[:, :1]
    temple = np.concatenate([0.9 * np.tanh(x / 0.06), 0.55 + 0 * x, 0 * x], axis=1)[:, None]
    way = (
        np.sin((1 - share) * angle)[..., None] * a[:, None] + np.sin(share * angle)[..., None] * b[:, None]
    ) / np.maximum(np.sin(angle), 1e-4)[..., None]
    way = unit(way + 0.9 * far_round * temple)
    radius = high[:, None] * (1 - share) + far[:, None] * share
    points = scalp.head_centre + way * radius[..., None]
    size = scalp.radius / 0.1
    layer = 0.0015 + 0.006 * site.own[:, 3]
    margin = (0.001 + (layer[:, None] + 0.004 * share) * smooth(share / 0.25)) * size
    points = obstacle.push_out(points.reshape(-1, 3), margin.ravel()).reshape(points.shape)
    points[:, 0] = site.roots.place
    return points


def _spine(knot: Knot, scalp: Scalp, obstacle: Obstacle, first: np.ndarray, length: float, turn: float, keep: float):
    """One hanging line (_TAIL, 3) [m] from the tie, and two unit vectors across it at each point."""
    size = scalp.radius / 0.1
    step = length * size / (_TAIL - 1)
    points, direction = [knot.place], unit(first)
    for vertex in range(1, _TAIL):
        direction = unit(direction + min(turn * step / size, 1.0) * (DOWN - direction))
        ahead = points[-1] + step * direction
        ahead = obstacle.push_out(ahead[None], keep * size * min(1.0, 0.3 + vertex / 12))[0]
        direction = unit(ahead - points[-1])
        points.append(points[-1] + step * direction)
    points = np.array(points)
    tangent = unit(np.gradient(points, axis=0))
    across = unit(np.cross(tangent, [1.0, 0.0, 0.0]))
    return points, unit(np.cross(across, tangent)), across


def _ponytail(site: Site, knot: Knot, scalp: Scalp, obstacle: Obstacle) -> np.ndarray:
    radius = scalp.radius
    spine, left, up = _spine(knot, scalp, obstacle, knot.out + [0, 0.35, 0], 0.36, 20.0, 0.025)
    # Strands end at different places: the tail tapers.
    share = np.linspace(0.0, 1.0, _TAIL) * (1 - 0.40 * site.own[:, 1:2] ** 1.5 - 0.10 * site.of_clump[:, 3:])
    spine, left, up = (at_vertices(line[None], share * (_TAIL - 1)) for line in (spine, left, up))
    spread = radius * (0.11 + 0.20 * smooth(share / 0.25) - 0.13 * smooth((share - 0.4) / 0.6))
    disc = knot.disc + 0.25 * (site.of_clump[:, :2] - 0.5)
    return spine + spread[..., None] * (disc[:, None, :1] * left + disc[:, None, 1:] * up)


def _braid(site: Site, knot: Knot, scalp: Scalp, obstacle: Obstacle) -> np.ndarray:
    radius = scalp.radius
    spine, left, up = _spine(knot, scalp, obstacle, knot.out + [0, -0.6, 0], 0.40, 30.0, 0.022)
    share = np.linspace(0.0, 1.0, _TAIL)
    third = np.floor((np.arctan2(knot.disc[:, 1], knot.disc[:, 0]) / (2 * np.pi) + 0.5) * 2.999)[:, None]
    plait = smooth(share / 0.08) * (1 - smooth((share - 0.86) / 0.04))
    angle = 2 * np.pi * (5.5 * share + third / 3)
    girth = radius * (0.20 - 0.06 * share)
    # Three bundles that pass each other: a figure of eight across the spine.
    aside = girth * plait * np.sin(angle)
    lift = 0.55 * girth * plait * np.sin(2 * angle)
    thick = girth * (0.62 - 0.40 * smooth((share - 0.82) / 0.05) * (1 - smooth((share - 0.88) / 0.12)))
    disc = np.sqrt(site.own[:, 2:3]) * _circle(site.own[:, 1])
    aside = aside + thick * disc[:, :1]
    lift = lift + thick * disc[:, 1:]
    return spine + aside[..., None] * left + lift[..., None] * up


def _bun(site: Site, knot: Knot, scalp: Scalp, obstacle: Obstacle) -> np.ndarray:
    radius = scalp.radius
    e1, e2 = _across(knot.out)
    share = np.linspace(0.0, 1.0, _TAIL)
    bearing = np.arctan2(knot.disc[:, 1], knot.disc[:, 0])[:, None]
    # Wound around the tie in rings that close over it; deeper strands run inside.
    around = bearing + 2 * np.pi * (1.6 + 0.5 * site.of_clump[:, :1]) * share
    shell = radius * (0.10 + 0.18 * np.sqrt(site.own[:, 1:2]))
    rolls = 2 * np.pi * (site.of_clump[:, 1:2] + 0.15 * site.own[:, 2:3] + 0.35 * share)
    begin = smooth(share / 0.15)
    ring = radius * 0.11 * (1 - begin) + begin * (0.22 * radius + shell * np.cos(rolls))
    high = begin * (0.20 * radius + shell * np.sin(rolls))
    flat = ring[..., None] * (np.cos(around)[..., None] * e1 + np.sin(around)[..., None] * e2)
    return knot.place + flat + high[..., None] * knot.out


def _circle(turns: np.ndarray) -> np.ndarray:
    """(S, 2) points on the unit circle at turns (S,)."""
    return np.stack([np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns)], axis=1)


STYLES = {
    "ponytail": Tied(Shape(clumping=0.35, frizz=0.0007), (0.0, 0.50, -1.0), _ponytail),
    "braid": Tied(Shape(vertices=48, clumping=0.0, frizz=0.0004), (0.0, -0.55, -1.0), _braid),
    "bun": Tied(Shape(vertices=40, clumping=0.0, frizz=0.0010), (0.0, 0.55, -1.0), _bun),
}
