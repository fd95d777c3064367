# SPDX-License-Identifier: Apache-2.0
"""Motion without motion capture: random clips for training, scripted ones for evaluation.

Both use the same gestures; sizes and times of the scripted clips are fixed and lie between the random ones.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from neuralocks_core.animation.gestures import GESTURES, KINDS, WILD, Dice
from neuralocks_core.animation.puppet import FRONT, SIDE, Puppet, ease, noise
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import Clip

MOST_WEIGHT = 100
"""Of a gesture among random ones, relative to each other one."""


def random_clip(
    character: Character,
    rng: np.random.Generator,
    seconds: float,
    rate: float = 30.0,
    shape: np.ndarray | None = None,
    wild: float = 0.2,
    weights: dict[str, float] | None = None,
    stops: float = 0.0,
) -> Clip:
    """A random motion of one to three gestures over swaying and posture; in a share of them the whole body spins or tumbles, and a
    share stops amid it.

    Args:
        character: who moves.
        rng: source of all randomness; the same state gives the same clip.
        seconds: length.
        rate: samples a second.
        shape: blend shape weights (B,).
        wild: the share in which the whole body spins or tumbles.
        weights: how often gestures are chosen, relative to all others, which have 1: see `check_weights`.
        stops: the share that stops midway and keeps its pose from then on, while hair comes to rest.
    """
    times = np.arange(round(seconds * rate) + 1) / rate
    puppet = Puppet(character, times)
    chosen = rng.choice(KINDS, size=int(rng.choice([1, 2, 3], p=[0.4, 0.4, 0.2])), p=_odds(weights or {}))
    _posture(puppet, rng)
    if "hold" not in chosen and rng.random() < 0.4:
        _fidget(puppet, rng)
    rare = [rng.choice(WILD)] if wild and rng.random() < wild else []
    for kind in dict.fromkeys(str(k) for k in (*chosen, *rare)):
        GESTURES[kind](puppet, Dice(rng, seconds))
    clip = puppet.clip(shape)
    return _stopped(clip, rng) if stops and rng.random() < stops else clip


def scripted_clip(character: Character, kind: str, seconds: float = 5.0, rate: float = 30.0) -> Clip:
    """The clip of one kind on which models are evaluated: every size and time is fixed. `fall_and_stop` and `hold` end still.

    Raises:
        NeuralocksError: the kind is not in GESTURES.
    """
    if kind not in GESTURES:
        raise NeuralocksError(f"motion '{kind}': unknown kind; use {', '.join(GESTURES)}")
    times = np.arange(round(seconds * rate) + 1) / rate
    puppet = Puppet(character, times)
    GESTURES[kind](puppet, Dice(None, seconds))
    return puppet.clip()


def check_weights(weights: dict[str, float]) -> dict[str, float]:
    """How often gestures are chosen: each a kind of KINDS with a weight from 0 to MOST_WEIGHT, not all of them 0.

    Raises:
        NeuralocksError: they are not.
    """
    for kind, weight in weights.items():
        if kind not in KINDS:
            raise NeuralocksError(f"--gesture {kind}: unknown kind of motion; use {', '.join(KINDS)}")
        if not 0 <= weight <= MOST_WEIGHT:
            raise NeuralocksError(f"--gesture {kind}={weight:g}: must be from 0 to {MOST_WEIGHT}")
    if not any(weights.get(kind, 1.0) for kind in KINDS):
        raise NeuralocksError("--gesture: leaves no kind of motion; give one of them more than 0")
    return weights


def _odds(weights: dict[str, float]) -> np.ndarray | None:
    """The chance of each of KINDS; None if they are alike, so that the same random numbers choose as without weights."""
    if not weights:
        return None
    each = np.array([weights.get(kind, 1.0) for kind in KINDS])
    return each / each.sum()


def _stopped(clip: Clip, rng) -> Clip:
    """The same motion until its time slows down and stands still, between a third and two thirds of its length."""
    begin = clip.start + rng.uniform(0.3, 0.65) * (clip.end - clip.start)
    brake = rng.uniform(0.1, 0.5)
    since = np.clip(clip.times - begin, 0, brake)
    return replace(clip, joints=clip.at(np.minimum(clip.times, begin) + since - since**2 / (2 * brake)))


def _posture(puppet: Puppet, rng) -> None:
    """Posture of head, trunk and arms throughout the clip; in some clips it changes once, slowly."""
    still = (
        np.ones(len(puppet.times))
        if rng.random() < 0.5
        else ease(puppet.times, rng.uniform(0.3, 1.5), rng.uniform(0.4, 1.5))
    )
    puppet.turn_neck(still[:, None] * rng.normal(size=3) * [0.15, 0.25, 0.08])
    puppet.bend_spine(still[:, None] * rng.normal(size=3) * [0.12, 0.12, 0.06])
    for side in ("left", "right"):
        if rng.random() < 0.3:
            lift = ease(puppet.times, rng.uniform(0.3, 2.0), rng.uniform(0.3, 1.0)) * rng.uniform(0.3, 2.2)
            out = FRONT if side == "left" else -FRONT
            axis = out * rng.uniform(0.2, 1.0) - SIDE * rng.uniform(0.0, 1.0)
            puppet.turn_further(f"{side}_upper_arm", lift[:, None] * axis)
            puppet.turn(f"{side}_shoulder", 0.15 * lift[:, None] * out)


def _fidget(puppet: Puppet, rng) -> None:
    size = rng.uniform(0.2, 1.0)
    highest = rng.uniform(0.5, 2.5)
    puppet.turn_neck(size * noise(puppet.times, rng, highest) * [0.12, 0.2, 0.08])
    puppet.bend_spine(size * noise(puppet.times, rng, 0.7) * [0.05, 0.06, 0.04])
    puppet.position += size * noise(puppet.times, rng, 0.9) * [0.03, 0.01, 0.03]
