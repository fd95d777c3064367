# SPDX-License-Identifier: Apache-2.0
"""Wind: an acceleration of all hair, the same everywhere, as a function of time alone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real

import numpy as np

from neuralocks_core.arguments import number_array
from neuralocks_core.errors import NeuralocksError

STRONGEST = 8.0
"""Largest mean of a wind [m/s^2]: beyond this, nobody has measured how far models are off."""
FREQUENCIES = np.array([0.23, 0.41, 0.67, 1.13, 1.7])
"""Of the gusts [Hz]. Hair hardly answers to faster ones, and to slower ones it hangs as in a steady wind."""
SHARES = np.array([0.29, 0.26, 0.21, 0.15, 0.09])
"""Amplitudes of these, which add up to 1."""
PHASES = np.array([[0.0, 2.4, 4.8, 0.9, 3.3], [1.1, 3.5, 5.9, 2.0, 4.4]])
"""Of the gusts along the wind, and of those across it [rad]."""
ACROSS = 0.5
"""How strong gusts across the wind are, relative to those along it."""


@dataclass(frozen=True)
class Wind:
    """A wind that blows from one side in gusts. Whatever the time is asked for, and in which order, it is the same wind.

    Hair of any weight is accelerated alike, and there is no lee: it blows through bodies.

    Attributes:
        mean: acceleration (3,) in world axes, Y up [m/s^2].
        gusts: by which share of the mean it varies, from 0 to 1.

    Raises:
        NeuralocksError: a number is not finite or out of range.
    """

    mean: tuple[float, float, float]
    gusts: float = 0.5

    def __post_init__(self):
        mean = number_array("wind", self.mean, "three numbers [m/s^2]")
        if mean.shape != (3,) or not np.isfinite(mean).all():
            raise NeuralocksError(f"wind: {self.mean} is not a vector; give three numbers [m/s^2]")
        if (size := math.hypot(*mean)) > STRONGEST * (1 + 1e-6):
            raise NeuralocksError(f"wind: is {size:.3g} m/s^2 strong; give at most {STRONGEST:g} (gravity is 9.81)")
        if not (isinstance(self.gusts, Real) and not isinstance(self.gusts, bool) and 0 <= self.gusts <= 1):
            raise NeuralocksError(f"gusts {self.gusts}: give a share of the wind from 0 to 1")
        object.__setattr__(self, "mean", tuple(mean.tolist()))

    def at(self, times: np.ndarray, period: float = 0.0) -> np.ndarray:
        """Accelerations (..., 3) [m/s^2] at times (...) [s].

        Args:
            times: any.
            period: of a motion that repeats [s]: the gusts then repeat with it. 0 if it does not.

        Raises:
            NeuralocksError: a time is not a finite number, or the period is none of 0 or above.
        """
        mean, times = np.array(self.mean), number_array("times", times, "seconds")
        if not np.isfinite(times).all():
            raise NeuralocksError("times: hold NaN or infinity; give seconds")
        if not (isinstance(period, Real) and 0 <= period < math.inf):
            raise NeuralocksError(f"period {period}: give seconds, 0 for motion that does not repeat")
        rates = np.maximum(np.round(FREQUENCIES * period), 1) / period if period > 0 else FREQUENCIES
        turns = 2 * np.pi * rates * times[..., None]
        along, across = ((SHARES * np.sin(turns + phase)).sum(-1)[..., None] for phase in PHASES)
        return mean + self.gusts * (along * mean + across * ACROSS * self._side())

    def _side(self) -> np.ndarray:
        """A level vector (3,) across the wind, as long as its mean."""
        x, y, z = self.mean
        level = np.array([z, 0.0, -x])
        size = math.hypot(x, z)
        return math.hypot(x, y, z) * (level / size if size > 1e-9 else np.array([1.0, 0.0, 0.0]))


def check_felt(feels: bool) -> None:
    """Refuse a wind for a model that does not feel it.

    Args:
        feels: whether it does.

    Raises:
        NeuralocksError: it does not.
    """
    if not feels:
        raise NeuralocksError(
            "wind: this model is for held poses, whose hair feels no wind; leave it out, or take a model with motion"
        )
