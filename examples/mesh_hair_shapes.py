# SPDX-License-Identifier: Apache-2.0
"""The shapes that the example of rigged mesh hair is made of: locks that fall from the parting, and a cap on the scalp."""

from typing import NamedTuple

import numpy as np
from pxr import UsdGeom

TOP, RINGS, SIDES = 8, 15, 10
"""Rings of a lock's tube above and below the point where it leaves the head, and vertices per ring."""
CLEARANCE = 0.008
"""Distance from the skin to the middle of a lock, beyond half its thickness [m]."""
ROUND = 0.11
"""Radius of a lock's bend across its width on the head [m]; the bend fades out over the same length below."""
THICKNESS, HAIRLINE = 0.009, 0.002
"""Distance of the cap from the skin, and at its edge [m]."""


class Lock(NamedTuple):
    """Where a lock begins, where it leaves the head, and its size.

    Attributes:
        parting: where on the head it begins: left and in front of the head joint [m].
        degrees: its direction from there, from the face to the left.
        height: above the head joint; below it, the lock hangs freely [m].
        length: of the free part [m].
        half_width, half_thickness: [m].
    """

    parting: tuple[float, float]
    degrees: float
    height: float
    length: float
    half_width: float
    half_thickness: float


def curve_of(collider, lock: Lock):
    """Centre line of a lock from parting to tip (n, 3), head at the origin, and its outward directions (n, 3)."""
    angle = np.radians(lock.degrees)
    out = np.array([np.sin(angle), 0.0, np.cos(angle)])
    clearance = lock.half_thickness + CLEARANCE
    # Down the skull on a slope, then free fall that keeps clear of neck and shoulders.
    points, flats = [], []
    step, travelled, falling = 0.004, 0.0, False
    place, heading = _onto_head(collider, lock.parting, clearance), out.copy()
    while travelled < lock.length:
        distance, normal = collider.distance(place[None], limit=0.1)
        place = place + normal[0] * max(0.0, clearance - distance[0]) if distance[0] < clearance else place
        if not falling and distance[0] > clearance + 0.002:
            place = place - normal[0] * (distance[0] - clearance) * 0.5
        points.append(place)
        flats.append(normal[0] if distance[0] < 0.06 and not falling else out)
        falling |= place[1] < lock.height
        pull = np.array([0.0, -1.0, 0.0]) + (0.0 if falling else 0.6) * out
        heading = heading + (0.25 if falling else 0.15) * (pull / np.linalg.norm(pull) - heading)
        heading /= np.linalg.norm(heading)
        place = place + step * heading
        travelled += step if falling else 0.0
    points, flats = np.array(points), np.array(flats)
    for _ in range(60):  # smooth, then clear again
        points[1:-1] += 0.5 * ((points[:-2] + points[2:]) / 2 - points[1:-1])
        flats[1:-1] += 0.5 * ((flats[:-2] + flats[2:]) / 2 - flats[1:-1])
    distance, normal = collider.distance(points, limit=0.1)
    points = points + normal * np.maximum(0, clearance - distance)[:, None]
    points[1:-1] = (points[:-2] + 2 * points[1:-1] + points[2:]) / 4
    start = int(np.argmax(points[:, 1] < lock.height))
    arc = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return (points, arc - arc[start]), flats / np.linalg.norm(flats, axis=1, keepdims=True)


def at(curve, arc):
    """Points (..., 3) of a curve at arc lengths."""
    points, arcs = curve
    return np.stack([np.interp(arc, arcs, points[:, i]) for i in range(3)], axis=-1)


def tube(curve, flats, lock: Lock):
    """A flat tapered tube, bent round the head: points (n, 3), faces, and arc length per point, divided by the chain's (n,)."""
    arcs = np.concatenate([np.linspace(curve[1][0], 0, TOP, endpoint=False), np.linspace(0, curve[1][-1], RINGS)])
    middle = at(curve, arcs)
    tangent = np.gradient(middle, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    thick = np.stack([np.interp(arcs, curve[1], flats[:, i]) for i in range(3)], axis=-1)
    thick -= (thick * tangent).sum(axis=1, keepdims=True) * tangent
    thick /= np.linalg.norm(thick, axis=1, keepdims=True)
    wide = np.cross(tangent, thick)
    share = (arcs - arcs[0]) / (arcs[-1] - arcs[0])
    size = np.sqrt(np.minimum(1, 0.2 + 2.5 * share)) * np.clip(1 - share**2.5, 0, 1) ** 0.8 + 0.02
    angle = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
    across = size[:, None] * lock.half_width * np.cos(angle)
    inwards = np.interp(arcs, [0, ROUND], [1, 0])[:, None] * across**2 / (2 * ROUND)
    outwards = size[:, None] * lock.half_thickness * np.sin(angle) - inwards
    rings = middle[:, None] + across[..., None] * wide[:, None] + outwards[..., None] * thick[:, None]
    faces = []
    for ring in range(len(arcs) - 1):
        for i in range(SIDES):
            a, b = ring * SIDES + i, ring * SIDES + (i + 1) % SIDES
            faces.append([a, a + SIDES, b + SIDES, b])
    faces.append(list(range(SIDES)))
    faces.append([(len(arcs) - 1) * SIDES + i for i in reversed(range(SIDES))])
    return rings.reshape(-1, 3), faces, np.repeat(np.clip(arcs / curve[1][-1], -1, 1), SIDES)


def cap(mesh: UsdGeom.Mesh, collider, head_at):
    """Points (n, 3) and faces of the cap: the scalp slightly off the skin, with a smooth hairline."""
    subset = UsdGeom.Subset(next(p for p in mesh.GetPrim().GetChildren() if p.GetName() == "scalp"))
    counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get())
    corners = np.split(np.asarray(mesh.GetFaceVertexIndicesAttr().Get()), np.cumsum(counts)[:-1])
    used, faces = np.unique([corners[f] for f in subset.GetIndicesAttr().Get()], return_inverse=True)
    faces = faces.reshape(-1, 4)  # our body has quads there
    points = np.asarray(mesh.GetPointsAttr().Get(), np.float64)[used] - head_at
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edges, uses = np.unique(ends, axis=0, return_counts=True)
    beside, along = (_means(chosen, len(used)) for chosen in (edges, edges[uses == 1]))
    on_edge = along.any(axis=1)
    # The scalp ends with whole faces, in steps: each vertex of its edge moves to the middle of its neighbours there, the others
    # make room, and all return to the skin.
    for _ in range(24):
        points[on_edge] += 0.5 * (along @ points - points)[on_edge]
        points[~on_edge] += 0.2 * (beside @ points - points)[~on_edge]
        distance, normal = collider.distance(points, limit=0.1)
        points -= distance[:, None] * normal
    rings = np.where(on_edge, 0.0, 1.0)
    for _ in range(2):
        rings = np.where(on_edge, 0.0, (rings + beside @ rings) / 2)
    return points + (HAIRLINE + (THICKNESS - HAIRLINE) * rings)[:, None] * normal, faces.tolist()


def _onto_head(collider, parting, clearance):
    """The place (3,) on top of the head at a parting, `clearance` off the skin."""
    place = np.array([parting[0], 0.19, parting[1]])  # 19 cm up is above every head
    for _ in range(30):
        place[1] -= 0.5 * (collider.distance(place[None], limit=0.1)[0][0] - clearance)
    return place


def _means(edges, count):
    """(count, count) mean of the vertices at the other ends of a vertex' edges."""
    matrix = np.zeros((count, count))
    matrix[edges[:, 0], edges[:, 1]] = matrix[edges[:, 1], edges[:, 0]] = 1
    return matrix / np.maximum(matrix.sum(axis=1, keepdims=True), 1)
