# SPDX-License-Identifier: Apache-2.0
"""Signed distance to the skin that moves relative to the head: samples with planes, blended to a smooth surface.

Samples are chosen once. Each frame only poses them and puts them into a grid; no tree is built.
"""

from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from neuralocks_core.body.collider import split_triangle
from neuralocks_core.body.tree_search import surface_tree
from neuralocks_core.native.library import library
from neuralocks_core.native.posed_skin import pose_skin
from neuralocks_core.sums import dot, in_order

SPACING = 0.010
"""Distance between samples on the skin [m]; half or a quarter of it where triangles are that small."""
NEIGHBOURS = 8
"""Samples that are blended; the first is the sample itself."""
CELL = 0.012
"""Width of the grid's cells [m]. A sample is entered in its own cell and those around it."""
SKIN = 2
"""Bit of a marked cell."""
DEPTH = 3
"""Cells below the skin into which a sample is entered too: hair may get that deep."""
ENOUGH_SAMPLES = 20_000
MOST_SAMPLES = 60_000
THIN = 0.002
"""A point farther below a sample than the body is thick there, by more than this [m], does not count as below it."""
MOST_CELLS = 4_000_000
SAME_SIDE, AROUND = 0.2, 3.0
"""A sample's neighbours have normals that differ from its own by less than the angle of this cosine, and are within this many
spacings of it."""
REACH = 3.2
"""Squared distance, in squared spacings beyond that of the nearest, at which a sample's weight reaches zero."""
BESIDE = 4.0
"""Squared distance beside the nearest sample, in squared spacings, at which its plane is no longer valid."""


class Box:
    """A grid of cubes over the space that hair can reach; `cells` numbers them, 0 is outside.

    Args:
        low, high: corners (3,) [m].
    """

    def __init__(self, low: np.ndarray, high: np.ndarray):
        span = np.maximum(np.asarray(high, float) - low, CELL)
        self.cell = max(CELL, float(np.cbrt(np.prod(span) / MOST_CELLS)))
        self.size = np.ceil(span / self.cell).astype(int) + 5
        # Cells are in the same places for all grooms of a head.
        self.low = (np.floor(np.asarray(low, float) / self.cell) - 2) * self.cell
        self.strides = np.array([self.size[1] * self.size[2], self.size[2], 1])
        self.count = int(np.prod(self.size))

    def cells(self, points: np.ndarray) -> np.ndarray:
        """Number of the cell (..., ) int32 of each point (..., 3) float32; an arbitrary cell for points outside the box."""
        index = None
        for axis in range(3):
            place = points[..., axis] - np.float32(self.low[axis])
            place *= np.float32(1 / self.cell)
            cell = place.astype(np.int32)
            cell *= np.int32(self.strides[axis])
            index = cell if index is None else np.add(index, cell, out=index)
        np.maximum(index, 0, out=index)
        return np.minimum(index, np.int32(self.count - 1), out=index)

    def inside(self, points: np.ndarray, border: int) -> np.ndarray:
        """Which points (N, 3) lie at least `border` cells within."""
        place = ((points - self.low) / self.cell).T
        held = [(x >= border) & (x < size - border) for x, size in zip(place, self.size)]
        return held[0] & held[1] & held[2]


class Skin:
    """Samples of a mesh: the triangle of each, the place on it, and its neighbours.

    Args:
        points: of the mesh in bind pose (V, 3) [m].
        triangles: those that move (F, 3), not empty, outward by the right-hand rule.
    """

    def __init__(self, points: np.ndarray, triangles: np.ndarray):
        triangle, part, spacing = _sampled(points, triangles)
        self.corners, self.part = triangles[triangle].astype(np.int32), part.astype(np.float32)
        place, normal = _planes(points, self.corners, self.part)
        count = min(NEIGHBOURS, len(place))
        self.square = np.square(spacing).astype(np.float32)
        tree = surface_tree(place)
        far, near = tree.query(place, k=np.arange(1, count + 1))
        near[:, 0] = np.arange(len(place))
        # Skin on the other side of a thin part is not a neighbour; the sample itself stands in for it.
        other = np.einsum("ni,nki->nk", normal, normal[near]) < SAME_SIDE
        own = np.arange(len(place))[:, None]
        self.thick = _thickness(place, normal, tree)
        self.near = np.where(other | (far > AROUND * spacing[:, None]), own, near).astype(np.int32)
        self.counted = np.where((self.near == own) & (np.arange(count) > 0), 0, 1).astype(np.float32)


class PosedSkin:
    """Skin in one pose.

    Args:
        skin: its samples.
        points: of the whole mesh in this pose (V, 3) [m].
        box: the grid.
        marks: (box.count,) uint8; cells near the skin get the bit SKIN.
        low, high: corners (3,) [m] of the space that will be queried.

    Attributes:
        skin: its samples.
        start: a sample near each cell (box.count,) int32, arbitrary in cells that are not marked.
        planes: place and unit normal (N, 6) float32 of each sample.
    """

    def __init__(self, skin: Skin, points: np.ndarray, box: Box, marks: np.ndarray, low, high):
        self.skin = skin
        room = (DEPTH + 1) * box.cell
        low = np.maximum(low - room, box.low + room).astype(np.float32)
        high = np.minimum(high + room, box.low + box.size * box.cell - room).astype(np.float32)
        posed = pose_skin if library() else _posed
        self.planes, self.start = posed(box, low, high, points, skin.corners, skin.part, marks)

    def rough(self, points: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Height [m] above the plane of a nearby sample, (N,), of points (N, 3) float32 in marked cells."""
        plane = self.planes.take(self.start.take(cells), axis=0)
        offset = points - plane[:, :3]
        offset *= plane[:, 3:]
        return offset[:, 0] + offset[:, 1] + offset[:, 2]

    @cached_property
    def _columns(self) -> np.ndarray:
        return np.ascontiguousarray(self.planes.T)

    def distance(self, points: np.ndarray, cells: np.ndarray, head: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed distance (N,) [m] and its direction (N, 3) of points (N, 3) in marked cells.

        Infinite beyond the rim, and where the head, at the distances `head` (N,), is nearer than a sample.
        """
        skin = self.skin
        sample = self.start.take(cells)
        place = np.ascontiguousarray(points.T, np.float32)[:, :, None]
        rows = np.arange(len(points))
        for _ in range(3):  # downhill from neighbour to neighbour
            near = skin.near.take(sample, axis=0)
            off = place - self._columns[:3].take(near, axis=1)
            squares = off * off
            squared = squares[0] + squares[1]
            squared += squares[2]
            best = squared.argmin(axis=1)
            sample = near[rows, best]
            if not best.any():
                break
        nearest = squared[rows, best]
        # Weights decrease from the nearest sample on: smooth in the point and in the pose, at any height.
        first = near[:, 0]
        square = skin.square.take(first)
        weight = np.maximum(1 - (squared - nearest[:, None]) / (REACH * square)[:, None], 0)
        weight *= weight
        weight *= skin.counted.take(first, axis=0)
        normal = self._columns[3:].take(near, axis=1)
        off *= normal
        height = off[0]
        height += off[1]
        height += off[2]
        value = dot(height, weight) / in_order(weight)
        direction = np.ascontiguousarray(in_order(normal * weight).T)
        direction /= np.maximum(np.sqrt(dot(direction, direction)), np.float32(1e-20))[:, None]
        beyond = nearest - value * value > BESIDE * square
        beyond |= nearest - 0.5 * square > head * head
        # A shoulder is thinner than the grid is deep: what is below its front may be behind its back.
        beyond |= -value > skin.thick.take(first) + np.float32(THIN)
        return np.where(beyond, np.inf, value), direction


def _posed(box: Box, low, high, points, corners, part, marks) -> tuple[np.ndarray, np.ndarray]:
    """What `posed_skin.c` computes: its description, and what runs where that does not. See `pose_skin` for the arguments."""
    place, normal = _planes(points, corners, part)
    planes, start = np.concatenate([place, normal], axis=1), np.empty(box.count, np.int32)
    asked = np.flatnonzero(((place > low) & (place < high)).all(axis=1))
    place, normal = place.take(asked, axis=0), normal.take(asked, axis=0)

    def enter(cells: np.ndarray) -> None:
        start[cells] = asked
        marks[cells] |= np.uint8(SKIN)

    # From the farthest cells to a sample's own: the last one entered is the nearest.
    for depth in range(DEPTH, 0, -1):
        enter(box.cells(place - normal * np.float32(depth * box.cell)))
    own = box.cells(place)
    # Around them, of samples in one cell the last one stands for all.
    start[own] = asked
    last = start.take(own) == asked
    own, asked = own[last], asked[last]
    around = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    for step in around[np.argsort(-np.abs(around).sum(axis=1), kind="stable")] @ box.strides:
        enter(own + np.int32(step))
    return planes, start


def _planes(points: np.ndarray, corners: np.ndarray, part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places and unit normals (N, 3) float32 of samples on triangles (N, 3) of points (V, 3) [m], at `part` (N, 2) of each."""
    points = np.asarray(points, np.float32)
    a, b, c = (points.take(corners[:, i], axis=0) for i in range(3))
    b -= a
    c -= a
    normal = np.stack(
        [b[:, 1] * c[:, 2] - b[:, 2] * c[:, 1], b[:, 2] * c[:, 0] - b[:, 0] * c[:, 2],
         b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]], axis=1)  # fmt: skip
    normal /= np.maximum(np.sqrt(dot(normal, normal)), np.float32(1e-20))[:, None]
    b *= part[:, :1]
    c *= part[:, 1:]
    a += b
    a += c
    return a, normal


def _thickness(place: np.ndarray, normal: np.ndarray, tree: cKDTree) -> np.ndarray:
    """Distance (N,) float32 [m] from each sample down to the skin on the other side; infinite if none is within reach."""
    thick = np.full(len(place), np.inf, np.float32)
    for depth in np.arange(0.5, DEPTH + 1.1, 0.5) * CELL:
        below = place - np.float32(depth) * normal
        off, other = tree.query(below, distance_upper_bound=CELL)
        found = np.flatnonzero(np.isfinite(off))
        other = other[found]
        found, other = (each[np.einsum("ni,ni->n", normal[found], normal[other]) < 0] for each in (found, other))
        height = np.einsum("ni,ni->n", place[found] - place[other], normal[found])
        thick[found] = np.minimum(thick[found], np.maximum(height, 0))
    return thick


def _sampled(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangle (N,), place on it (N, 2) and spacing (N,) [m] of samples: closer together where triangles are small."""
    corners = np.asarray(points, float)[triangles]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    for finest in (2, 1, 0):
        halved = np.clip(np.round(np.log2(SPACING / np.maximum(edges.mean(axis=1), 1e-9))), 0, finest)
        owner, part, spacing = _thinned(corners, edges.max(axis=1), SPACING / 2**halved)
        if len(owner) <= ENOUGH_SAMPLES:
            break
    return owner, part, spacing


def _thinned(corners: np.ndarray, longest: np.ndarray, spacing: np.ndarray):
    """Samples of triangles (F, 3, 3) with a spacing each (F,), as `_sampled`."""
    wide = 1.5 * spacing
    while (np.maximum(np.ceil(longest / wide), 1) ** 2).sum() > max(MOST_SAMPLES, len(longest)):
        wide = 1.3 * wide
    split = np.maximum(np.ceil(longest / wide), 1).astype(int)
    owner, part = [], []
    for m in np.unique(split):
        which, uv = np.flatnonzero(split == m), split_triangle(m)
        owner.append(np.repeat(which, len(uv)))
        part.append(np.tile(uv, (len(which), 1)))
    owner, part = np.concatenate(owner), np.concatenate(part)
    spacing = spacing[owner]
    a, b, c = (corners[owner, i] for i in range(3))
    place = (a + part[:, :1] * (b - a) + part[:, 1:] * (c - a)) / (0.8 * spacing[:, None])
    # In each small cube, the sample nearest to its middle is enough.
    cube = np.floor(place)
    off = np.square(place - cube - 0.5).sum(axis=1)
    order = np.lexsort((off, spacing, cube[:, 2], cube[:, 1], cube[:, 0]))
    key = np.column_stack([cube, spacing])[order]
    first = np.concatenate([[True], (np.diff(key, axis=0) != 0).any(axis=1)])
    kept = np.sort(order[first])
    return owner[kept], part[kept], spacing[kept]
