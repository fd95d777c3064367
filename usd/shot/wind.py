# SPDX-License-Identifier: Apache-2.0
"""The wind of a bake: as a user gives it and a bake records it, in the stage's axes, and as the core takes it."""

from dataclasses import replace
from numbers import Real

import numpy as np
from pxr import Gf, Usd

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.wind import Wind

from ..border.amounts import check_number
from ..border.units import Border
from .bakes.bake_record import in_stage, recorded, seen_as_written


def as_wind(mean, gusts: float | None = None) -> Wind | None:
    """The wind that a caller asks for, in the stage's axes; None for a calm.

    Args:
        mean: three numbers [m/s^2], or None.
        gusts: by which share of the mean it varies; `Wind`'s default if None.

    Raises:
        NeuralocksError: not a wind, or gusts without one.
    """
    if gusts is not None:
        check_number("--gusts", gusts, 0, 1)
    if mean is None:
        if gusts is not None:
            raise NeuralocksError(f"--gusts {gusts:g}: there is no wind that could vary; give --wind X,Y,Z, too")
        return None
    given = mean.tolist() if isinstance(mean, np.ndarray) else mean
    given = [*given] if isinstance(given, list | tuple | Gf.Vec3d | Gf.Vec3f) else []
    if len(given) != 3 or not all(isinstance(each, Real) for each in given):
        raise NeuralocksError(f"wind: {mean!r} is not one; give three numbers [m/s^2], such as (2, 0, 0)")
    wind = Wind(tuple(given)) if gusts is None else Wind(tuple(given), float(gusts))
    return wind if any(wind.mean) else None


def in_core(wind: Wind | None, border: Border) -> Wind | None:
    """A wind in the stage's axes, in the core's."""
    return wind and replace(wind, mean=tuple(_turn(border) @ wind.mean))


def wind_facts(wind: Wind | None) -> dict:
    """The record of a wind in the stage's axes; empty for a calm."""
    return {} if wind is None else {"wind": Gf.Vec3d(*wind.mean), "gusts": float(wind.gusts)}


def recorded_wind(prim: Usd.Prim, border: Border) -> Wind | None:
    """The wind that a bake was made with, in the core's axes; None for a calm.

    Raises:
        NeuralocksError: what is recorded is not a wind, or the stage turns the bake, or plays it at another time: it does not tell
            how, so nobody knows from where the wind blows then.
    """
    told = recorded(prim)
    if "wind" not in told:
        return None
    if not seen_as_written(prim, border) or not in_stage(prim):
        raise NeuralocksError(
            f"{prim.GetPath()}: was baked in a wind, and is brought in here by a reference or with an offset, another unit or axis; "
            "compare the bake's own file with the reference"
        )
    try:
        return in_core(as_wind(tuple(told["wind"]), told.get("gusts")), border)
    except (NeuralocksError, TypeError) as error:
        raise NeuralocksError(
            f"{prim.GetPath()}: its bake records a wind that cannot be read ({error}); bake again"
        ) from None


def _turn(border: Border) -> np.ndarray:
    """Rotation (3, 3) from the stage's axes to the core's."""
    return border.to_core[:3, :3] / border.metres_per_unit
