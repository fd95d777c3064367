# SPDX-License-Identifier: Apache-2.0
"""The material of hair: the four numbers that an artist sets and the network reads, and fixed constants."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from numbers import Real

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.number_words import plain_number

RANGES = {
    "bend": (2e-4, 5e-3),
    "weight": (0.5, 2.0),
    "damping": (4.0, 20.0),
    "clumping": (0.0, 240.0),
}
"""Ranges that models are trained on; values outside are refused."""

ALIASES = {"stiffness": "bend"}
"""Artists' names -> ours."""

STRETCH = 1000.0
"""Stiffness of edges against stretch [m^2/s^2], per unit line density as all others."""
COLLISION = 1e6
"""Stiffness of the body [1/(m s^2)]."""
MARGIN = 0.004
"""Distance that hair keeps from the body [m], unless it rests nearer."""
NO_PLANE = (0.0, 0.0, 0.0, -1e3)
"""Body plane n, d for a vertex without a body nearby: everything on earth is outside of it."""
LINEAR = 0.02
"""Depth in the body [m] from which the force stops growing."""
SMOOTHING = 0.015
"""h of the density that detects crowded hair [m]: each vertex is spread over 2 h."""

UNREAD = [list(RANGES).index(name) for name in ("weight", "clumping")]
"""Which constants a boundary vector holds for the law of clumping alone: networks are given zeros for them."""

_SOFT = 20.0  # clumping may be 0, which has no logarithm: this offset is added first


@dataclass(frozen=True)
class Material:
    """Constants of the rods, per unit line density.

    Attributes:
        bend: bending stiffness [m^4/s^2]; the default is EI over line density of a human hair.
        weight: factor on gravity.
        damping: of velocity relative to the head [1/s].
        clumping: stiffness of the ties between neighbours (adhesion) [1/s^2].

    Raises:
        NeuralocksError: a value is not a number, not finite or outside RANGES.
    """

    bend: float = 1e-3
    weight: float = 1.0
    damping: float = 10.0
    clumping: float = 60.0

    def __post_init__(self):
        for name, value in asdict(self).items():
            _check(name, value, name)
            object.__setattr__(self, name, float(value))  # plain, as files of USD and JSON take it

    def log_ratios(self) -> np.ndarray:
        """(4,) float32: logarithms of the ratios to the default material, as the network reads them; zero for the default."""
        default = Material()
        ratios = [
            self.bend / default.bend,
            self.weight / default.weight,
            self.damping / default.damping,
            (self.clumping + _SOFT) / (default.clumping + _SOFT),
        ]
        return np.log(ratios).astype(np.float32)

    @classmethod
    def random(cls, rng: np.random.Generator) -> Material:
        """A material for a training rollout: each constant is the default in a third of all cases, else anywhere in its range."""
        values = {}
        for name, (low, high) in RANGES.items():
            shift = _SOFT if name == "clumping" else 0.0
            anywhere = float(np.exp(rng.uniform(np.log(low + shift), np.log(high + shift))) - shift)
            values[name] = getattr(cls(), name) if rng.random() < 1 / 3 else float(np.clip(anywhere, low, high))
        return cls(**values)

    @classmethod
    def parse(cls, settings: list[str] | tuple[str, ...]) -> Material:
        """Build it from `NAME=VALUE` words; the value is absolute, or a factor on the default when it ends in `x` (`bend=2x`).

        Raises:
            NeuralocksError: a name is unknown or given twice, or a value is not a number or outside its range.
        """
        given: dict[str, float] = {}
        for setting in settings:
            if not isinstance(setting, str):
                raise NeuralocksError(f"material {setting!r}: is not a word; write NAME=VALUE, for example 'bend=1.5x'")
            said, _, text = (part.strip() for part in setting.partition("="))
            name = ALIASES.get(said, said)
            if name not in RANGES:
                known = ", ".join([*ALIASES, *RANGES])
                raise NeuralocksError(f"material '{setting}': unknown name; use {known} as NAME=VALUE")
            if "=" in text.lstrip("="):
                raise NeuralocksError(
                    f"material '{setting}': more than one NAME=VALUE; give each by itself (--material)"
                )
            try:
                factor = getattr(cls(), name) if text.endswith("x") else 1.0
                value = plain_number(text.removesuffix("x")) * factor
            except ValueError:
                raise NeuralocksError(
                    f"material '{setting}': no number after '='; write for example {said}=1.5x"
                ) from None
            _check(name, value, said)
            if name in given:
                raise NeuralocksError(f"material '{setting}': {name} is given twice; give it once")
            given[name] = value
        return cls(**given)


def at_weight_one(log_ratios: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The hair of weight 1 that moves like this one at another speed, and how many times as fast this one is.

    Divided by the weight w, a rod's equation of motion is that of bending stiffness B / w, damping c / sqrt(w) and clumping k / w,
    with time in units of 1 / sqrt(w): dynamic similarity, after Froude. So a network that knows hair of weight 1 knows every
    weight, if it reads the motion at that speed.

    Args:
        log_ratios: (..., 4), see `Material.log_ratios`.

    Returns:
        The other hair's log-ratios (..., 4) float64, and sqrt(w) (...,).
    """
    bend, weight, damping, clumping = np.moveaxis(np.asarray(log_ratios, np.float64), -1, 0)
    tie = np.maximum((Material.clumping + _SOFT) * np.exp(clumping) - _SOFT, 0) / np.exp(weight)
    tie = np.log((tie + _SOFT) / (Material.clumping + _SOFT))
    return np.stack([bend - weight, np.zeros_like(weight), damping - weight / 2, tie], axis=-1), np.exp(weight / 2)


def _check(name: str, value, said: str) -> None:
    """Refuse a value that a constant cannot have; the message uses the user's name for it."""
    low, high = RANGES[name]
    if isinstance(value, bool) or not isinstance(value, Real):
        raise NeuralocksError(f"material {said}: {value!r} is not a number; give one from {low:g} to {high:g}")
    if not np.isfinite(value) or not low * (1 - 1e-6) <= value <= high * (1 + 1e-6):  # rounding in single precision
        raise NeuralocksError(
            f"material {said}: {value:g} is outside {low:g} to {high:g}; choose a value inside, or a factor such as 2x"
        )


def constants(log_ratios: np.ndarray) -> tuple[float, float, float, float]:
    """Bend, weight, damping and clumping in the units of `Material`, from its `log_ratios` (4,).

    In single precision, values may leave the ranges by one part in a million; clumping is never below 0.
    """
    default, ratio = Material(), np.exp(np.asarray(log_ratios, np.float64))
    tie = (default.clumping + _SOFT) * ratio[3] - _SOFT
    return default.bend * ratio[0], default.weight * ratio[1], default.damping * ratio[2], max(float(tie), 0.0)
