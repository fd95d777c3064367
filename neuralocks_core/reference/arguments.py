# SPDX-License-Identifier: Apache-2.0
"""Checks of the simulators' arguments: a wrong shape or number is reported before anything is computed."""

from collections.abc import Mapping
from dataclasses import asdict
from numbers import Integral, Real
from typing import Any

import numpy as np

from neuralocks_core.arguments import number_array
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import RANGES, Material
from neuralocks_core.reference.rest import RestRods

CLAMPED_WITHIN = 1e-4
"""A start's clamped vertices may be this far from those of rest [m]: files round."""
LENGTH_WITHIN = 0.01
"""Its edges may be longer or shorter than those of rest by this share: the first step gives them their lengths."""

_KNOWN = ", ".join(RANGES)


def check_settings(dt: float, margin: float, gravity: float, **counts: int) -> None:
    """What every simulator is told: `counts` are substeps and the like, the others as in `solver.simulate`.

    Raises:
        NeuralocksError: a number is none, not finite, or out of range.
    """
    told = ", ".join(f"{name} {value}" for name, value in counts.items())
    if not (_from_zero(dt) and dt > 0) or not all(_from_zero(count) and count >= 1 for count in counts.values()):
        raise NeuralocksError(f"dt {dt}, {told}: must be positive numbers")
    if not all(isinstance(count, Integral) for count in counts.values()):
        raise NeuralocksError(f"{told}: give whole steps")
    if not _from_zero(gravity):
        raise NeuralocksError(f"gravity {gravity}: give 0 or more [m/s^2]; it pulls down, along -Y")
    check_amounts(margin=margin)


def check_amounts(**amounts: float) -> None:
    """Settings that may be 0.

    Raises:
        NeuralocksError: one is no number, not finite, or below 0.
    """
    for name, value in amounts.items():
        if not _from_zero(value):
            raise NeuralocksError(f"{name} {value}: must be a number of 0 or above")


def check_material(material: Any, strands: int) -> dict[str, np.ndarray]:
    """bend [m^4/s^2], weight [factor on gravity], damping [1/s] and clumping [1/s^2], each (S,), finite and not negative.

    Args:
        material: an object or a mapping with these names, each a number or (S,); missing ones have `Material`'s default.
        strands: S.

    Raises:
        NeuralocksError: a number is invalid, a shape is wrong, a mapping has another name, or an object none of these.
    """
    defaults = asdict(Material())
    if material is None:
        given = {}
    elif isinstance(material, Mapping):
        given = material
    else:
        given = {name: getattr(material, name) for name in defaults if hasattr(material, name)}
        if not given:
            raise NeuralocksError(f"material {material!r}: is not one; give a Material, or a dict of {_KNOWN}")
    for name in given:
        if name not in defaults:
            raise NeuralocksError(f"material {name!r}: unknown name; the known ones are {_KNOWN}")
    found = {}
    for name, default in defaults.items():
        value, wanted = given.get(name, default), f"a number of at least 0, or one for each of {strands} strands"
        numbers = number_array(f"material {name}", value, wanted)
        known = np.asarray(value).dtype.kind != "b" and numbers.shape in ((), (1,), (strands,))
        if not known or not np.isfinite(numbers).all() or (numbers < 0).any():
            raise NeuralocksError(f"material {name}: give {wanted}")
        found[name] = np.broadcast_to(numbers, (strands,)).copy()
    return found


def check_neighbours(neighbours: np.ndarray | None, strands: int) -> np.ndarray:
    """(S, N) int32, N may be 0.

    Raises:
        NeuralocksError: wrong shape or a strand that does not exist.
    """
    if neighbours is None:
        return np.zeros((strands, 0), np.int32)
    neighbours = np.asarray(neighbours)
    if neighbours.ndim != 2 or len(neighbours) != strands or neighbours.dtype.kind not in "iu":
        raise NeuralocksError(f"neighbours: shape {neighbours.shape}; give integers ({strands}, N)")
    if neighbours.size and (neighbours.max() >= strands or neighbours.min() < -1):
        raise NeuralocksError(f"neighbours: name strands outside 0..{strands - 1}; use -1 for none")
    return neighbours.astype(np.int32)


def check_body(body: Any, triangles: np.ndarray | None, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """The first frame's points (V, 3), and the faces (F, 3).

    Raises:
        NeuralocksError: too few frames, wrong shapes, faces out of range, points that are not finite.
    """
    if len(body) != frames:
        raise NeuralocksError(f"body: {len(body)} frames for {frames} of the head; give one for each")
    first, faces = number_array("body", body[0], "points (T, V, 3) in metres"), np.asarray(triangles)
    if first.ndim != 2 or first.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
        raise NeuralocksError("body: give points (T, V, 3) and triangles (F, 3)")
    if faces.dtype.kind not in "iu":
        raise NeuralocksError(f"triangles: are of type {faces.dtype}; give whole numbers, the vertices of each")
    if faces.min() < 0 or faces.max() >= len(first):
        raise NeuralocksError(f"triangles: name vertices outside 0..{len(first) - 1}")
    return check_pose("body", first, len(first)), faces


def check_pose(name: str, points: Any, vertices: int) -> np.ndarray:
    """(V, 3) float64: the body's points in one pose [m].

    Raises:
        NeuralocksError: these are not its `vertices`, or not finite.
    """
    points = number_array(name, points, f"points ({vertices}, 3) in metres")
    if points.shape != (vertices, 3):
        raise NeuralocksError(f"{name}: shape {points.shape}; give the vertices of the first frame, ({vertices}, 3)")
    if not np.isfinite(points).all():
        raise NeuralocksError(f"{name}: holds values that are not finite; check its skinning")
    return points


def check_start(start: np.ndarray | None, rods: RestRods) -> np.ndarray | None:
    """(S, K, 3) float64 canonical points at the first frame [m], if any.

    Raises:
        NeuralocksError: wrong shape, not finite, not clamped where the rods are, or of other lengths.
    """
    if start is None:
        return None
    shape = rods.points.shape
    start = number_array("start", start, f"{shape} metres")
    if start.shape != shape:
        raise NeuralocksError(f"start: shape {start.shape}; give {shape}, as rest")
    if not np.isfinite(start).all():
        raise NeuralocksError("start: holds NaN or infinity; give points in metres")
    away = np.linalg.norm(start - rods.points, axis=-1)[:, :2].max()
    if away > CLAMPED_WITHIN:
        raise NeuralocksError(f"start: a root is {away:.3g} m from that of rest; give vertices 0 and 1 as in rest")
    edge, length = np.linalg.norm(np.diff(start, axis=1), axis=-1), rods.length[:, 1:]
    off = np.abs(edge / length - 1).max()
    if off > LENGTH_WITHIN:
        raise NeuralocksError(
            f"start: an edge's length is off by {100 * off:.3g} %; give edges as long as those of rest"
        )
    return start


def check_wind(wind: np.ndarray | None, frames: int) -> np.ndarray:
    """(T, 3) float64, zeros for None.

    Raises:
        NeuralocksError: wrong shape, or not finite.
    """
    wind = np.zeros((frames, 3)) if wind is None else number_array("wind", wind, f"{(frames, 3)} m/s^2")
    if wind.shape != (frames, 3) or not np.isfinite(wind).all():
        raise NeuralocksError(f"wind: shape {wind.shape}; give finite accelerations {(frames, 3)}, one for each frame")
    return wind


def _from_zero(value: Any) -> bool:
    """Whether it is a finite number of 0 or above."""
    return isinstance(value, Real) and not isinstance(value, bool) and 0 <= value < np.inf
