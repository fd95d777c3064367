# SPDX-License-Identifier: Apache-2.0
"""Checks of the metrics' arguments: arrays that numpy would repeat to fit give numbers that mean nothing."""

import numpy as np

from neuralocks_core.arguments import number_array
from neuralocks_core.errors import NeuralocksError


def hair_of(times=None, length=None, **hair) -> list[np.ndarray]:
    """Hair (T, S, K, 3) of one shape by the names of arguments, and then its times (T,) or lengths (S,), in floating point.

    Raises:
        NeuralocksError: shapes differ, nothing is there, times do not ascend, or a length is not above 0.
    """
    arrays = [reals(name, given, "(T, S, K, 3) metres") for name, given in hair.items()]
    shape = arrays[0].shape
    for name, array in zip(hair, arrays):
        if array.ndim != 4 or array.shape[3] != 3 or not array.size:
            raise NeuralocksError(f"{name}: is of shape {array.shape}; give frames of hair, (T, S, K, 3)")
        if array.shape != shape:
            raise NeuralocksError(f"{name}: is of shape {array.shape}; give {shape}, as {next(iter(hair))}")
    if times is not None:
        arrays.append(ascending(times, shape[0]))
    if length is not None:
        length = reals("length", length, "(S,) metres")
        if length.shape != shape[1:2] or not (length > 0).all():
            raise NeuralocksError(
                f"length: give a number of metres above 0 for each of {shape[1]} strands, ({shape[1]},)"
            )
        arrays.append(length)
    return arrays


def rows_of(name: str, values, rest_name: str, rest) -> tuple[np.ndarray, np.ndarray]:
    """Values (T, N) and those at rest (N,), in floating point.

    Raises:
        NeuralocksError: their shapes do not fit, or there are no frames.
    """
    values, rest = reals(name, values, "(T, N) metres"), reals(rest_name, rest, "(N,) metres")
    if values.ndim != 2 or not len(values) or rest.shape != values.shape[1:]:
        raise NeuralocksError(f"{name}: is of shape {values.shape}, {rest_name} of {rest.shape}; give (T, N) and (N,)")
    return values, rest


def shaped(name: str, given, wanted: str, *shape: int | None) -> np.ndarray:
    """Numbers of a shape, in floating point.

    Args:
        name: of the argument.
        given: what a caller gives for it.
        wanted: its shape and unit, for the message.
        shape: sizes of its axes; None for any.

    Raises:
        NeuralocksError: they are of another shape.
    """
    array = reals(name, given, wanted)
    if array.ndim != len(shape) or any(size not in (None, found) for size, found in zip(shape, array.shape)):
        raise NeuralocksError(f"{name}: is of shape {array.shape}; give {wanted}")
    return array


def edges_of(points) -> np.ndarray:
    """Edges (..., K - 1, 3) of strands (..., K, 3), in double precision.

    Raises:
        NeuralocksError: these are no strands.
    """
    points = number_array("points", points, "(..., K, 3) metres")
    if points.ndim < 2 or points.shape[-1] != 3:
        raise NeuralocksError(f"points: are of shape {points.shape}; give strands, (..., K, 3)")
    return np.diff(points, axis=-2)


def counts_of(counts, points: int) -> np.ndarray:
    """Vertices (S,) of each strand, of points in all.

    Raises:
        NeuralocksError: they are no whole numbers from 0 on, or of more or fewer points.
    """
    counts = np.asarray(counts)
    if counts.dtype.kind not in "iu" or counts.ndim != 1 or (counts < 0).any() or counts.sum() != points:
        raise NeuralocksError(f"counts: give whole numbers of vertices, (S,), which add up to the {points} points")
    return counts


def ascending(times, count: int) -> np.ndarray:
    """Times (count,) [s], ascending.

    Raises:
        NeuralocksError: there are more or fewer, or they do not ascend.
    """
    times = reals("times", times, "(T,) seconds")
    if times.shape != (count,) or not (np.diff(times) > 0).all():
        raise NeuralocksError(f"times: give ascending seconds, one for each of {count} frames")
    return times


def reals(name: str, given, wanted: str) -> np.ndarray:
    """What a caller gives, in its own precision; whole numbers, whose differences may wrap around, in double.

    Raises:
        NeuralocksError: these are not numbers.
    """
    own = isinstance(given, np.ndarray) and given.dtype.kind == "f"
    return number_array(name, given, wanted, given.dtype if own else np.float64)
