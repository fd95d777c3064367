# SPDX-License-Identifier: Apache-2.0
"""What people do with their heads and bodies, with the sizes and timings of people: a curve over time for each gesture.

Sizes and times are random, or fixed between the random ones: see `Dice`.
"""

from __future__ import annotations

import numpy as np

from neuralocks_core.animation.puppet import FRONT, SIDE, UP, Puppet, ease, leap, pulse, swing, travelled
from neuralocks_core.motion import G

KINDS = ("shake", "turn", "nod", "bow", "tilt", "sway", "translate", "jump", "walk", "fall_and_stop", "hold")
WILD = ("spin", "tumble")
"""Rarer and farther from standing: dancing and falling, which models learn, but are evaluated on only if asked."""
FOREIGN = ("bang",)
"""Headbanging, which no random clip contains: how a model responds to motion unlike its training."""
REST = 0.3
"""[s] A random clip begins motionless, so that its hair correctly begins at rest."""


class Dice:
    """Numbers between limits: random, or always the same one near the middle for scripted clips."""

    def __init__(self, rng: np.random.Generator | None, seconds: float):
        self.rng, self.seconds = rng, seconds

    def between(self, low: float, high: float) -> float:
        return low + 0.55 * (high - low) if self.rng is None else float(self.rng.uniform(low, high))

    def sign(self) -> float:
        return 1.0 if self.rng is None else float(self.rng.choice([-1.0, 1.0]))

    def start(self, latest_share: float = 0.5) -> float:
        """When a gesture begins [s]."""
        return 0.5 if self.rng is None else self.between(REST, max(REST + 0.01, latest_share * self.seconds))

    def repeats(self) -> int:
        return 2 if self.rng is None else int(self.rng.integers(1, 4))

    def direction(self) -> np.ndarray:
        """A horizontal unit vector."""
        angle = self.between(0, 2 * np.pi)
        return np.array([np.sin(angle), 0.0, np.cos(angle)])


def _shake(puppet: Puppet, dice: Dice) -> None:
    wave = swing(puppet.times, dice.start(), dice.between(2, 5), dice.between(1.0, 2.6))
    puppet.turn_neck(wave[:, None] * UP * dice.sign() * dice.between(0.2, 0.75))


def _turn(puppet: Puppet, dice: Dice) -> None:
    start = dice.start(0.3)
    for _ in range(dice.repeats()):
        attack, hold, release = dice.between(0.2, 0.8), dice.between(0.1, 1.0), dice.between(0.2, 0.8)
        angle = dice.sign() * dice.between(0.4, 1.3)
        curve = pulse(puppet.times, start, attack, hold, release)
        puppet.turn_neck(curve[:, None] * UP * angle)
        if dice.between(0, 1) > 0.5:
            puppet.turn("root", ease(puppet.times, start, 2 * attack)[:, None] * UP * angle * dice.between(0.3, 2.4))
        start += attack + hold + release + dice.between(0.1, 0.6)


def _nod(puppet: Puppet, dice: Dice) -> None:
    wave = swing(puppet.times, dice.start(), dice.between(2, 4), dice.between(0.8, 2.2))
    puppet.turn_neck(wave[:, None] * SIDE * dice.between(0.15, 0.5))


def _bow(puppet: Puppet, dice: Dice) -> None:
    curve = pulse(puppet.times, dice.start(0.3), dice.between(0.4, 1.2), dice.between(0.2, 1.5), dice.between(0.4, 1.2))
    angle = dice.between(0.3, 1.4)
    puppet.bend_spine(curve[:, None] * SIDE * angle)
    puppet.turn_neck(curve[:, None] * SIDE * dice.between(-0.2, 0.5))


def _tilt(puppet: Puppet, dice: Dice) -> None:
    start = dice.start(0.3)
    for _ in range(dice.repeats()):
        attack, hold = dice.between(0.25, 0.7), dice.between(0.2, 0.9)
        curve = pulse(puppet.times, start, attack, hold, attack)
        puppet.turn_neck(curve[:, None] * (FRONT + 0.2 * SIDE) * dice.sign() * dice.between(0.2, 0.75))
        start += 2 * attack + hold + 0.2


def _sway(puppet: Puppet, dice: Dice) -> None:
    wave = swing(puppet.times, dice.start(0.2), dice.between(2, 5), dice.between(0.4, 1.2))[:, None]
    puppet.position += wave * dice.direction() * dice.between(0.03, 0.12)
    puppet.bend_spine(wave * FRONT * dice.sign() * dice.between(0.0, 0.2))


def _translate(puppet: Puppet, dice: Dice) -> None:
    start = dice.start(0.3)
    for _ in range(dice.repeats()):
        duration = dice.between(0.3, 0.9)
        puppet.position += ease(puppet.times, start, duration)[:, None] * dice.direction() * dice.between(0.15, 1.0)
        start += duration + dice.between(0.1, 0.8)


def _jump(puppet: Puppet, dice: Dice) -> None:
    start = dice.start(0.3)
    for _ in range(dice.repeats()):
        height, deep, down = dice.between(0.08, 0.4), dice.between(0.08, 0.2), dice.between(0.25, 0.45)
        rise, over = leap(puppet.times, start, height, deep, dice.between(0.5, 0.9) * deep, down, 0.45)
        puppet.position += rise[:, None] * UP
        puppet.bend_spine(pulse(puppet.times, start, down, 0.0, 0.3)[:, None] * SIDE * 0.3)
        start = over + dice.between(-0.2, 0.5)


def _walk(puppet: Puppet, dice: Dice) -> None:
    """Walking from a standing start; hips bob twice a stride."""
    times, steps = puppet.times, dice.between(1.5, 2.6)
    speed = 0.75 * steps * dice.between(0.7, 1.1)
    begin = dice.start(0.2)
    going = ease(times, begin, 0.8) - ease(times, times[0] + dice.seconds * dice.between(0.6, 1.2), 0.7)
    phase = np.pi * steps * (times - begin)
    way = speed * travelled(times, going)
    bob = dice.between(0.015, 0.05) * (steps / 2) ** 2
    puppet.position += way[:, None] * FRONT + (going * bob * np.cos(2 * phase) - going * bob)[:, None] * UP
    puppet.position += (going * 0.02 * np.sin(phase))[:, None] * SIDE
    puppet.bend_spine((going * 0.1 * np.sin(phase))[:, None] * UP + (going * 0.05)[:, None] * SIDE)
    puppet.turn_neck((-going * 0.05 * np.sin(phase))[:, None] * UP)
    stride = going * dice.between(0.3, 0.55)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        leg = stride * np.sin(phase) * sign
        puppet.turn(f"{side}_upper_leg", -leg[:, None] * SIDE)
        puppet.turn(f"{side}_lower_leg", (stride * np.maximum(0, np.cos(phase) * sign))[:, None] * SIDE * 1.3)
        puppet.turn_further(f"{side}_upper_arm", 0.7 * leg[:, None] * SIDE)


def _fall_and_stop(puppet: Puppet, dice: Dice) -> None:
    """Free fall, as from a platform, and a hard stop."""
    times, start = puppet.times, dice.start(0.4)
    height, brake = dice.between(0.2, 0.9), dice.between(0.06, 0.2)
    fall = np.sqrt(2 * height / G)
    speed = G * fall
    t = np.clip(times - start, 0, fall)
    s = np.clip(times - start - fall, 0, brake)
    puppet.position -= (0.5 * G * t**2 + speed * (s - s**2 / (2 * brake)))[:, None] * UP
    puppet.bend_spine(pulse(times, start + fall, 0.15, 0.05, 0.4)[:, None] * SIDE * dice.between(0.0, 0.3))


def _hold(puppet: Puppet, dice: Dice) -> None:
    """A pose taken slowly and kept: the head to one side and down."""
    curve = ease(puppet.times, 0.3, 0.8)[:, None]
    turn = np.array([0.35, 0.5, 0.2]) if dice.rng is None else dice.rng.normal(size=3) * [0.4, 0.5, 0.25]
    puppet.turn_neck(curve * turn)


def _spin(puppet: Puppet, dice: Dice) -> None:
    """Some revolutions of the whole body, as in a pirouette."""
    attack, hold, release = dice.between(0.15, 0.5), dice.between(0.2, 1.8), dice.between(0.15, 0.6)
    rate = dice.sign() * dice.between(4.0, 14.0) * pulse(puppet.times, dice.start(0.3), attack, hold, release)
    puppet.turn("root", travelled(puppet.times, rate)[:, None] * UP)


def _tumble(puppet: Puppet, dice: Dice) -> None:
    """The whole body tips over about a horizontal axis: it falls to the ground, or rolls, or turns a cartwheel."""
    whole = dice.between(0, 1) > 0.6
    angle = dice.sign() * (2 * np.pi if whole else dice.between(0.6, 2.8))
    duration = abs(angle) / dice.between(2.0, 5.0)
    curve = ease(puppet.times, dice.start(0.3), duration)
    puppet.turn_about(dice.between(0.0, 1.4), curve[:, None] * dice.direction() * angle)


def _bang(puppet: Puppet, dice: Dice) -> None:
    """The bent head is thrown down and up over and over, by trunk and neck."""
    times, start = puppet.times, dice.start(0.3)
    rate, beats, size = dice.between(0.8, 2.2), dice.between(3, 8), dice.between(0.25, 0.7)
    bent = pulse(times, start, 0.5, max(0.0, beats / rate - 1.0), 0.5)[:, None] * SIDE
    beat = swing(times, start, beats, rate)[:, None] * SIDE
    puppet.turn_neck(size * beat + dice.between(-0.1, 0.4) * bent)
    puppet.bend_spine(dice.between(0.0, 0.5) * size * beat + dice.between(0.0, 0.9) * bent)


GESTURES = {
    "shake": _shake,
    "turn": _turn,
    "nod": _nod,
    "bow": _bow,
    "tilt": _tilt,
    "sway": _sway,
    "translate": _translate,
    "jump": _jump,
    "walk": _walk,
    "fall_and_stop": _fall_and_stop,
    "hold": _hold,
    "spin": _spin,
    "tumble": _tumble,
    "bang": _bang,
}
"""Add one gesture to a puppet's motion, by its name."""
