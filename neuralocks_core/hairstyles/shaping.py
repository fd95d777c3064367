# SPDX-License-Identifier: Apache-2.0
"""What makes grown strands look like hair: clumps that gather towards the tips, waves and curls, frizz, and distance to skin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from neuralocks_core.hairstyles.growth import CHUNK, Site, at_vertices, smooth
from neuralocks_core.hairstyles.obstacle import Obstacle
from neuralocks_core.progress import Progress, silent
from neuralocks_core.rotation import unit


@dataclass(frozen=True)
class Shape:
    """Lengths in metres on a head of 0.1 m radius."""

    vertices: int = 24
    """Vertices of a strand."""
    clump_spacing: float = 0.009
    """Distance between the roots of neighbouring clumps."""
    clumping: float = 0.6
    """0 to 1: how far tips gather onto their clump's leader."""
    wave: float = 0.0
    """Amplitude of a flat wave."""
    curl: float = 0.0
    """Radius of a helix."""
    pitch: float = 0.05
    """Axis length of one wave or turn."""
    curl_from: float = 0.02
    """Axis length over which wave or curl grows to its full size."""
    scatter: float = 0.15
    """Share of a turn by which strands of one clump differ."""
    unison: float = 0.0
    """0 to 1: how far neighbouring clumps wave together."""
    frizz: float = 0.0006
    """How far single strands stray."""


def shaped(
    axis: np.ndarray, site: Site, shape: Shape, obstacle: Obstacle, size: float, progress: Progress = silent
) -> np.ndarray:
    """(S, shape.vertices, 3) float32 [m]: strands grown along `axis` (S, K, 3), their roots unmoved.

    Args:
        axis: strands before shaping [m].
        site: their roots and clumps.
        shape: how to shape them.
        obstacle: what strands keep out of.
        size: head radius in units of 0.1 m.
        progress: called with (done, total, message).
    """
    gathered = _clumped(axis, site, shape.clumping, size)
    points = np.empty((len(axis), shape.vertices, 3), np.float32)
    for start in range(0, len(axis), CHUNK):
        progress(start, len(axis), "shaping")
        part = slice(start, start + CHUNK)
        points[part] = _swung(gathered[part], site.rows(part), shape, obstacle, size)
    points[:, 0] = axis[:, 0]
    return points


def _swung(points: np.ndarray, site: Site, shape: Shape, obstacle: Obstacle, size: float) -> np.ndarray:
    """The part of `shaped` after clumping, strand by strand."""
    if shape.vertices != points.shape[1]:
        place = np.linspace(0.0, points.shape[1] - 1, shape.vertices)
        points = _rounded(points, np.broadcast_to(place, (len(points), shape.vertices)))
    share = np.linspace(0.0, 1.0, shape.vertices)
    length = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1, keepdims=True)
    arc = length * share
    across, up = _frame(points)
    grown = smooth(arc / (shape.curl_from * size))
    # One phase for a clump: its strands swing together, otherwise curls become a haze.
    together = site.seen @ np.array([[0.5], [-0.9], [0.7]])
    turns = (1 - shape.unison) * site.of_clump[:, :1] + shape.unison * together
    turns = turns + shape.scatter * (site.own[:, :1] - 0.5)
    handed = np.where(site.of_clump[:, 1:2] < 0.5 * (1 - shape.unison), -1.0, 1.0)
    pitch = shape.pitch * size * (1 + 0.4 * (1 - shape.unison) * (site.of_clump[:, 2:3] - 0.5))
    angle = 2 * np.pi * (handed * arc / pitch + turns)
    start = angle[:, :1]
    if shape.wave:
        swing = shape.wave * size * grown * (np.sin(angle) - np.sin(start))
        points = points + (swing[..., None] * across).astype(np.float32)
    if shape.curl:
        radius = shape.curl * size * grown * (0.75 + 0.5 * site.own[:, 1:2])
        points = points + (radius * (np.cos(angle) - np.cos(start) * (1 - grown)))[..., None] * across
        points = points + (radius * (np.sin(angle) - np.sin(start) * (1 - grown)))[..., None] * up
    if shape.frizz:
        wander = _wander(site.own, arc / size)
        points = points + shape.frizz * size * smooth(arc / (0.03 * size))[..., None] * wander
    return _clear(points, arc, obstacle, size)


def _clumped(points: np.ndarray, site: Site, strength: float, size: float) -> np.ndarray:
    """Strands pulled to their clump's leader, little near the root and most at the tip."""
    if strength <= 0:
        return points
    share = np.linspace(0.0, 1.0, points.shape[1], dtype=np.float32)[:, None]
    own = (0.55 + 0.45 * site.of_clump[:, 3] - 0.25 * site.own[:, 2]).astype(np.float32)[:, None, None]
    # Stubble stands on its own.
    reach = np.linalg.norm(points[:, -1] - points[:, 0], axis=1)[:, None, None]
    own = own * smooth(reach / (0.02 * size))
    pull = np.clip(strength * own, 0.0, 0.95) * smooth(share / 0.7)
    return points + pull * (points[site.guide] - points)


def _rounded(points: np.ndarray, place: np.ndarray) -> np.ndarray:
    """`at_vertices` with rounded corners: averaged over half a vertex to both sides."""
    last = points.shape[1] - 1
    return sum(at_vertices(points, np.clip(place + shift, 0, last)) for shift in (-0.4, 0.0, 0.4)) / np.float32(3)


def _frame(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across each strand at each vertex (S, K, 3), transported without twist."""
    tangent = unit(np.gradient(points, axis=1))
    level = np.cross(tangent[:, 0], [0.0, 1.0, 0.0])
    weak = np.linalg.norm(level, axis=1) < 0.1
    level[weak] = np.cross(tangent[weak, 0], [0.0, 0.0, 1.0])
    across = np.empty_like(points)
    current = unit(level)
    for vertex in range(points.shape[1]):
        t = tangent[:, vertex]
        current = unit(current - (current * t).sum(axis=1, keepdims=True) * t)
        across[:, vertex] = current
    return across, np.cross(tangent, across)


def _wander(own: np.ndarray, arc: np.ndarray) -> np.ndarray:
    """(S, K, 3) smooth random offsets of about unit size, different for every strand."""
    wander = np.empty((*arc.shape, 3), np.float32)
    for axis in range(3):
        slow, fast = 2 * np.pi * own[:, axis : axis + 1], 2 * np.pi * own[:, axis + 1 : axis + 2]
        wander[..., axis] = np.sin(arc * (55 + 12 * slow) + 7 * fast) + 0.5 * np.sin(arc * (160 + 20 * fast) + 9 * slow)
    return wander


def _clear(points: np.ndarray, arc: np.ndarray, obstacle: Obstacle, size: float) -> np.ndarray:
    """Strands pushed outside the skin."""
    margin = (0.0005 + 0.002 * smooth(arc / (0.02 * size))) * size
    flat = points.reshape(-1, 3)
    for _ in range(2):
        flat = obstacle.push_out(flat, margin.ravel())
    return flat.reshape(points.shape)
