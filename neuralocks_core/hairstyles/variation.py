# SPDX-License-Identifier: Apache-2.0
"""Variations of a style, by number: with another cut, parting, waves and direction.

Artists' hair is never quite one of the library's styles. A network that has seen many variations of each style
makes smaller errors on it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from neuralocks_core.hairstyles.growth import Plan, Site, at_vertices, smooth
from neuralocks_core.hairstyles.obstacle import Obstacle
from neuralocks_core.hairstyles.shaping import Shape
from neuralocks_core.rotation import unit


@dataclass(frozen=True)
class Variation:
    """Lengths in metres on a head of 0.1 m radius; each field describes a change of a style."""

    length: float
    """Factor on the length of hair that is not tied, before scissors."""
    keep: float
    """Share of each strand that scissors leave."""
    layers: float
    """Share that scissors cut further off some strands, clump by clump."""
    volume: float
    """Factor on the distance kept from the skin."""
    lift: float
    """How much more strands rise at the root, as a slope."""
    comb: float
    """Turn of the comb about the normals of the scalp [rad]."""
    drift: tuple[float, float, float]
    """Added to the direction of the fall."""
    turn: float
    """Factor on how fast strands begin to fall."""
    hem: float
    """Added to the height of a straight cut, in head radii."""
    tie: tuple[float, float, float]
    """Added to the direction of a tie."""
    sunk: float
    """How deep hair that lies on the skin is pressed into it."""
    shape: dict[str, float]
    """Factors on fields of `Shape`."""
    wave: float
    """Amplitude of a wave for hair without one."""
    pitch: float
    """Length of that wave."""

    @classmethod
    def numbered(cls, number: int, style: str) -> Variation:
        """Variation `number` of a style, always the same for the same number."""
        random = np.random.default_rng([number, *style.encode()])
        between, times = random.uniform, lambda low, high: float(np.exp(random.uniform(np.log(low), np.log(high))))
        often = random.random(4) < [0.6, 0.5, 0.5, 0.35]
        return cls(
            length=times(0.6, 1.3),
            keep=between(0.3, 1.0) if often[0] else 1.0,
            layers=between(0.0, 0.5) if often[1] else 0.0,
            volume=between(0.0, 1.6),
            lift=between(-0.3, 0.6),
            comb=between(-0.5, 0.5),
            drift=(between(-0.25, 0.25), 0.0, between(-0.25, 0.25)),
            turn=times(0.6, 1.6),
            hem=between(-0.6, 0.8),
            tie=tuple(between(-0.35, 0.35, 3)),
            sunk=between(0.0, 0.010) if often[2] else 0.0,
            shape={
                "clump_spacing": times(0.7, 1.5),
                "clumping": between(0.2, 1.15),
                "wave": between(0.2, 1.6),
                "curl": between(0.3, 1.5),
                "pitch": times(0.75, 1.4),
                "frizz": times(0.4, 2.5),
            },
            wave=between(0.001, 0.010) if often[3] else 0.0,
            pitch=times(0.04, 0.15),
        )

    def of_shape(self, shape: Shape) -> Shape:
        """A style's `Shape` with this variation."""
        values = {name: factor * getattr(shape, name) for name, factor in self.shape.items()}
        values["clumping"] = min(values["clumping"], 0.95)
        if self.wave and not shape.wave and not shape.curl:
            values |= {"wave": self.wave, "pitch": self.pitch, "unison": 0.6}
        return replace(shape, **values)

    def of_plan(self, plan: Plan, site: Site) -> Plan:
        """A style's `Plan` with this variation."""
        normal = site.roots.normal
        sideways = np.cross(normal, plan.comb)
        comb = unit(np.cos(self.comb) * plan.comb + np.sin(self.comb) * sideways)
        return replace(
            plan,
            length=self.length * plan.length,
            first=unit(plan.first + (comb - plan.comb) + self.lift * normal),
            comb=comb,
            fall=unit(plan.fall + self.drift),
            turn=self.turn * plan.turn,
            margin=self.volume * plan.margin,
            cut=plan.cut + self.hem,
        )

    def trimmed(self, axis: np.ndarray, site: Site) -> np.ndarray:
        """(S, K, 3) strands after the scissors."""
        left = self.keep * (1 - self.layers * site.of_clump[:, 2:3] - 0.1 * self.layers * site.own[:, 2:3])
        return at_vertices(axis, left * np.linspace(0.0, axis.shape[1] - 1, axis.shape[1]))

    def pressed(self, points: np.ndarray, obstacle: Obstacle, size: float) -> np.ndarray:
        """(S, K, 3) [m] strands pressed into the skin where they lie on it, their roots unmoved."""
        if not self.sunk:
            return points
        distance, out = obstacle.distance(points.reshape(-1, 3))
        arc = np.cumsum(np.linalg.norm(np.diff(points, axis=1, prepend=points[:, :1]), axis=2), axis=1)
        depth = self.sunk * size * np.exp(-np.maximum(distance, 0) / (0.012 * size)).reshape(arc.shape)
        return points - (depth * smooth(arc / (0.02 * size)))[..., None] * out.reshape(points.shape)
