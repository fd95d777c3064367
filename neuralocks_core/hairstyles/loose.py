# SPDX-License-Identifier: Apache-2.0
"""Styles whose hair is not tied: each defines how a strand grows from every root."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from neuralocks_core.hairstyles.growth import DOWN, Plan, Site, march, smooth
from neuralocks_core.hairstyles.obstacle import Obstacle
from neuralocks_core.hairstyles.scalp import Scalp
from neuralocks_core.hairstyles.shaping import Shape
from neuralocks_core.hairstyles.style import Style
from neuralocks_core.hairstyles.variation import Variation
from neuralocks_core.rotation import unit


@dataclass(frozen=True)
class Loose(Style):
    """A style that defines how strands grow step by step from each root."""

    plan: Callable[[Site], Plan]

    def axis(self, site: Site, scalp: Scalp, obstacle: Obstacle) -> np.ndarray:
        return march(site, self.plan(site), scalp, obstacle)

    def varied(self, variation: Variation) -> Loose:
        return replace(
            self,
            shape=variation.of_shape(self.shape),
            plan=lambda site: variation.of_plan(self.plan(site), site),
        )


def _falling(
    site: Site,
    length: float,
    parting: float = 0.0,
    volume: float = 0.012,
    lift: float = 0.45,
    back: float = 1.0,
    soft: float = 0.0,
) -> Plan:
    """Hair that parts at `parting` head radii to the left, lies over the head to both sides and hangs.

    `back` combs it off the face, `soft` blurs the parting.
    """
    count = len(site.seen)
    x, y, z = site.seen.T
    # The parting ends behind the crown: from there on hair falls back.
    behind = smooth((0.1 - z) / 0.7)
    to_side = np.tanh((x - _parting(site.seen, parting)) / (0.04 + soft + 0.5 * behind))
    top = smooth((y - 0.2) / 0.6)
    comb = np.stack(
        [
            to_side * (1.0 - 0.65 * behind),
            -0.35 - 0.5 * (1 - top),
            -0.35 * behind - back * (0.30 + 0.25 * smooth(z)),
        ],
        axis=1,
    )
    comb = site.along_scalp(comb + 0.10 * (site.of_clump[:, :3] - 0.5))
    keeps = np.where(np.abs(x) < 0.02, np.sign(to_side), np.sign(x + 1e-6))
    keeps = np.where((z > 0.2) & (y > 0.2), np.sign(to_side), keeps)
    fall = DOWN + np.stack([-0.03 * np.sign(to_side) * smooth(z + 0.3), 0 * x, -0.12 * np.ones(count)], axis=1)
    # Hair from above lies over hair from below.
    layer = 0.15 + 0.65 * smooth((y + 0.7) / 1.6) + 0.2 * site.own[:, 3]
    return Plan(
        length=length * (1 - 0.10 * site.of_clump[:, 3] - 0.12 * site.own[:, 0] ** 3),
        first=unit(comb + lift * site.roots.normal),
        comb=comb,
        comb_reach=np.full(count, 0.16),
        fall=unit(fall),
        turn=np.full(count, 30.0),
        margin=volume * layer,
        side=keeps,
        cut=np.full(count, -np.inf),
    )


def _parting(seen: np.ndarray, parting: float) -> np.ndarray:
    """(S,) where the parting runs: straight over the top, back to the middle at the crown."""
    return parting * smooth((seen[:, 2] + 0.6) / 0.8)


def _sides(parting: float) -> Callable[[np.ndarray], np.ndarray]:
    """Zones left and right of a parting, one zone behind it."""
    return lambda seen: np.where(seen[:, 2] < -0.45, 0.0, np.where(seen[:, 0] > _parting(seen, parting), 1.0, -1.0))


def _long_straight(site: Site) -> Plan:
    plan = _falling(site, 0.50, volume=0.009, back=0.6)
    plan.cut = -3.9 - 0.5 * site.of_clump[:, 0] ** 2 - 0.25 * site.own[:, 1]
    return plan


def _wavy(site: Site) -> Plan:
    return _falling(site, 0.40, parting=0.28, volume=0.015, lift=0.6, back=0.8)


def _bob(site: Site) -> Plan:
    plan = _falling(site, 0.34, parting=0.25, volume=0.011, lift=0.5, back=0.4)
    # Cut straight at the jaw, a little longer in front, the tips turned in.
    plan.cut = -1.25 - 0.12 * smooth(site.seen[:, 2]) - 0.05 * site.own[:, 1]
    plan.fall = unit(plan.fall - 0.28 * np.stack([site.seen[:, 0], 0 * plan.side, 0 * plan.side], axis=1))
    return plan


def _bangs(seen: np.ndarray) -> np.ndarray:
    """(S,) bool: a triangle on top of the head and the whole forehead."""
    x, y, z = seen.T
    return (z > 0.25 + 0.5 * np.abs(x)) & (np.abs(x) < 0.75) & (y > 0.25)


def _fringe(site: Site) -> Plan:
    plan = _falling(site, 0.36, volume=0.011, back=0.1)
    plan.cut = -1.95 - 0.2 * site.of_clump[:, 0] - 0.1 * site.own[:, 1]
    x, y, z = site.seen.T
    front = _bangs(site.seen)
    forward = site.along_scalp(np.stack([0.25 * x, 0 * x, 1 + 0 * x], axis=1) + 0.06 * (site.of_clump[:, :3] - 0.5))
    bangs = dict(
        length=0.17,
        comb=forward,
        first=unit(forward + 0.6 * site.roots.normal),
        comb_reach=0.07,
        fall=unit(np.stack([0.12 * x, -1 + 0 * x, 0.05 + 0 * x], axis=1)),
        turn=45.0,
        margin=0.004 + 0.006 * smooth((0.9 - z) / 0.5) + 0.002 * site.own[:, 3],
        side=0.0,
        cut=0.16 - 0.10 * np.abs(x) ** 2 - 0.05 * site.own[:, 1] - 0.05 * site.of_clump[:, 1],
    )
    for name, value in bangs.items():
        mine = np.broadcast_to(np.asarray(value), getattr(plan, name).shape)
        setattr(plan, name, np.where(front if mine.ndim == 1 else front[:, None], mine, getattr(plan, name)))
    return plan


def _pixie(site: Site) -> Plan:
    x, y, z = site.seen.T
    # Away from the whorl at the back of the crown; in front, swept to one side.
    away = site.seen - [0.1, 0.85, -0.45]
    away = away + np.stack([0.8 * smooth((z - 0.2) / 0.6), 0 * x, 0 * x], axis=1)
    comb = site.along_scalp(unit(away) + 0.55 * (site.of_clump[:, :3] - 0.5))
    top = smooth((y + 0.35) / 1.2)
    return Plan(
        length=(0.022 + 0.043 * top) * (0.7 + 0.45 * site.of_clump[:, 3] + 0.12 * site.own[:, 0]),
        first=unit(comb + (0.35 + 0.6 * top[:, None] * site.of_clump[:, 1:2]) * site.roots.normal),
        comb=comb,
        comb_reach=np.full(len(x), 0.10),
        fall=np.broadcast_to(DOWN, comb.shape),
        turn=np.full(len(x), 38.0),
        margin=0.003 + 0.008 * top * (0.4 + 0.6 * site.own[:, 3]),
        side=np.zeros(len(x)),
        cut=np.where(z > 0.4, 0.42 - 0.40 * site.of_clump[:, 2] - 0.05 * site.own[:, 1], -np.inf),
    )


def _tight_curls(site: Site) -> Plan:
    plan = _falling(site, 0.24, parting=-0.2, volume=0.030, lift=1.2, soft=0.25)
    plan.turn = np.full(len(plan.side), 18.0)
    plan.length = plan.length * (0.85 + 0.15 * site.of_clump[:, 0])
    return plan


def _coils(site: Site) -> Plan:
    plan = _falling(site, 0.13, volume=0.028, lift=1.2, soft=1.0, back=1.3)
    plan.turn = np.full(len(plan.side), 20.0)
    return plan


def _standing(site: Site, length: np.ndarray, direction: np.ndarray) -> Plan:
    """Hair that stands on end."""
    count = len(site.seen)
    return Plan(
        length=length,
        first=direction,
        comb=direction,
        comb_reach=np.full(count, 1.0),
        fall=direction,
        turn=np.full(count, 5.0),
        margin=np.full(count, 0.002),
        side=np.zeros(count),
        cut=np.full(count, -np.inf),
    )


def _afro(site: Site) -> Plan:
    outward = unit(site.seen + [0.0, 0.15, -0.05])
    stray = 0.35 * (site.of_clump[:, :3] - 0.5) + 0.2 * (site.own[:, :3] - 0.5)
    # Up to the surface of one ball around the head, from any root; shorter over ears and nape.
    reach = 1.95 - np.linalg.norm(site.seen, axis=1) - 0.35 * smooth((0.1 - site.seen[:, 1]) / 0.8)
    short = 0.35 + 0.65 * smooth(site.roots.border / 0.03)
    length = 0.1 * np.maximum(reach, 0.25) * short * (0.93 + 0.09 * site.of_clump[:, 3])
    return _standing(site, length, unit(0.7 * outward + 0.3 * site.roots.normal + stray))


def _mohawk(site: Site) -> Plan:
    x, y, z = site.seen.T
    crest = smooth((0.30 - np.abs(x)) / 0.06)
    fan = np.stack([-0.9 * x, np.ones(len(x)), 0.55 * z + 0.1], axis=1)
    stray = 0.28 * (site.of_clump[:, :3] - 0.5) + 0.05 * (site.own[:, :3] - 0.5)
    length = 0.095 * (0.8 + 0.15 * site.of_clump[:, 3] + 0.12 * site.own[:, 0]) * (0.7 + 0.3 * smooth((y + 0.2) / 0.8))
    stubble = unit(site.roots.normal + 0.6 * site.along_scalp([0.0, -0.5, -1.0]))
    tall = crest[:, None] > 0.5
    direction = np.where(tall, unit(unit(fan) + 0.8 * site.roots.normal * [0.2, 1, 1] + stray), stubble)
    return _standing(site, np.where(tall[:, 0], length, 0.004 + 0.002 * site.own[:, 0]), direction)


def _mohawk_density(seen: np.ndarray) -> np.ndarray:
    return np.where(np.abs(seen[:, 0]) < 0.27, 1.0, 0.10)


STYLES = {
    "long_straight": Loose(Shape(clumping=0.55, frizz=0.0007), _long_straight, zone=_sides(0.0)),
    "wavy": Loose(
        Shape(32, clump_spacing=0.014, clumping=0.8, wave=0.008, pitch=0.085, curl_from=0.12, unison=0.7),
        _wavy,
        zone=_sides(0.28),
    ),
    "bob": Loose(Shape(clump_spacing=0.008, clumping=0.45, frizz=0.0006), _bob, zone=_sides(0.25)),
    "fringe": Loose(
        Shape(clump_spacing=0.008, clumping=0.5, frizz=0.0006),
        _fringe,
        zone=lambda seen: np.where(_bangs(seen), 2.0, _sides(0.0)(seen)),
    ),
    "pixie": Loose(Shape(clump_spacing=0.011, clumping=0.85, frizz=0.0008), _pixie),
    "tight_curls": Loose(
        Shape(64, clump_spacing=0.012, clumping=0.85, curl=0.0065, pitch=0.026, curl_from=0.05, frizz=0.0008),
        _tight_curls,
    ),
    "coils": Loose(
        Shape(96, clump_spacing=0.009, clumping=0.9, curl=0.0035, pitch=0.0095, curl_from=0.015, frizz=0.0007),
        _coils,
        zone=_sides(0.0),
    ),
    "afro": Loose(
        Shape(72, clump_spacing=0.006, clumping=0.5, curl=0.0024, pitch=0.007, curl_from=0.01, scatter=1.0),
        _afro,
    ),
    "mohawk": Loose(
        Shape(clump_spacing=0.011, clumping=0.85, frizz=0.0006),
        _mohawk,
        density=_mohawk_density,
        zone=lambda seen: np.where(np.abs(seen[:, 0]) < 0.27, 1.0, 0.0),
    ),
}
