# SPDX-License-Identifier: Apache-2.0
"""Checks of training options: invalid ones, before the simulations begin, and those that a resumed training changes."""

from __future__ import annotations

import dataclasses

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.training.networks import MOTIONS, OUTPUTS, STRAND_MAPS

CHOICES = {"output": OUTPUTS, "motion": MOTIONS, "strand_map": STRAND_MAPS, "optimiser": ("muon", "adamw")}
SHARES = ("mirror", "warmup")
"""Settings that are a share, at most 1."""
MOST = {"minutes": 100_000, "steps": 1_000_000_000, "rollouts": 1_000_000, "processes": 256}
"""Values above these are typing errors: a hundred thousand processes would take a machine down."""
MOST_IN_A_STEP = {"clips": 10_000, "moments": 1000, "poses": 10_000, "strands": 100_000, "pool": 10_000_000}
"""Above these, no machine has enough memory."""

BUDGET = ("minutes", "steps", "device")
"""Options that do not change what is learned."""


def check_options(options, rollouts: int = 1, processes: int = 1) -> None:
    """Refuse amounts out of bounds, unknown words, weights below 0 and shares above 1.

    Args:
        options: `RegressionOptions` or `SelfSupervisedOptions`.
        rollouts, processes: see `train.train_strands`.

    Raises:
        NeuralocksError: the message names the option.
    """
    _check_amounts({**vars(options), "rollouts": rollouts, "processes": processes})
    for name, default in ((field.name, field.default) for field in dataclasses.fields(options)):
        _check(name, getattr(options, name), default)


def changed(before: dict, now: dict) -> list[str]:
    """Options that a resumed training would change, one text each.

    Args:
        before, now: options by name, as plain values; those that were not recorded before are ignored.
    """
    other = [name for name in now if name in before and name not in BUDGET and before[name] != now[name]]
    return [f"{name} {now[name]} after {before[name]}" for name in other]


def _check_amounts(given: dict) -> None:
    """Refuse those of MOST that are out of bounds; options that are not given are ignored."""
    for name, most in MOST.items():
        value = given.get(name)
        if isinstance(value, (int, float)) and not 0 < value <= most:
            raise NeuralocksError(f"--{name} {value:g}: must be above 0, and at most {most:,}")


def _check(name: str, value, default) -> None:
    """Check one option of a method, whose default tells its kind."""
    if name in CHOICES and value not in CHOICES[name]:
        raise NeuralocksError(f"--set {name}={value}: is unknown; give {'|'.join(CHOICES[name])}")
    if name == "seed" and not 0 <= value < 2**32:
        raise NeuralocksError(f"--seed {value}: must be a whole number from 0, below 2^32")
    if type(default) is int and name != "seed" and value < 1:
        raise NeuralocksError(f"--set {name}={value}: must be at least 1")
    if value is not None and name in MOST_IN_A_STEP and value > MOST_IN_A_STEP[name]:
        raise NeuralocksError(f"--set {name}={value}: must be at most {MOST_IN_A_STEP[name]:,}")
    if isinstance(default, tuple) and not len(value):
        raise NeuralocksError(f"--set {name}: is empty; give a number, or one for each groom")
    if isinstance(default, float | tuple) and not all(v >= 0 for v in np.atleast_1d(value)):
        raise NeuralocksError(f"--set {name}={value}: must not be below 0")
    if name in SHARES and value > 1:
        raise NeuralocksError(f"--set {name}={value:g}: is a share; give a number from 0 to 1")
