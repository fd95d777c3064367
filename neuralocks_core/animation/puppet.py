# SPDX-License-Identifier: Apache-2.0
"""Moves a character by hand-written curves: rotations of semantic joints and of the whole body over time."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BPoly

from neuralocks_core import rotation
from neuralocks_core.character import Character
from neuralocks_core.motion import Clip, G

UP, SIDE, FRONT = np.eye(3)[1], np.eye(3)[0], np.eye(3)[2]
"""Canonical axes: Y up, X to the character's left, Z to its front."""


class Puppet:
    """Curves under construction for one character.

    Rotations are vectors in canonical axes, relative to the bind pose and to the joint's parent; the arms hang to
    begin with.

    Args:
        character: who moves.
        times: sample times (T,) [s].
    """

    def __init__(self, character: Character, times: np.ndarray):
        self.character, self.times = character, np.asarray(times, float)
        self.position = np.zeros((len(self.times), 3))
        """(T, 3) [m], of the whole body, canonical axes."""
        self._turns: dict[str, np.ndarray] = {}
        self.turn("root", np.zeros((len(self.times), 3)))
        for side in ("left", "right"):
            self._hang_arm(side)

    def turn(self, joint: str, vectors: np.ndarray) -> None:
        """Add rotation vectors (T, 3) [rad] to a joint's curve; `root` is the whole body. Joints that the rig lacks are ignored."""
        if joint != "root" and joint not in self.character.humanoid:
            return
        self._turns[joint] = self._turns.get(joint, 0.0) + vectors

    def turn_further(self, joint: str, vectors: np.ndarray) -> None:
        """Turn a joint by rotation vectors (T, 3) [rad] on top of its motion so far, about its parent's axes.

        Needed if a joint turns far, as hanging arms do: rotation vectors add up only while they are small.
        """
        if joint in self.character.humanoid:
            before = self._turns.get(joint, 0.0) + np.zeros_like(vectors)
            self._turns[joint] = rotation.to_vector(rotation.from_vector(vectors) @ rotation.from_vector(before))

    def turn_about(self, height: float, vectors: np.ndarray) -> None:
        """Turn the whole body by rotation vectors (T, 3) [rad] about a point at this height above its root [m]."""
        self.turn("root", vectors)
        self.position += height * (UP - rotation.from_vector(vectors) @ UP)

    def turn_neck(self, vectors: np.ndarray) -> None:
        """Turn the head by rotation vectors (T, 3) [rad], a third of it in the neck, as people do."""
        share = 1 / 3 if "neck" in self.character.humanoid else 0.0
        self.turn("neck", share * vectors)
        self.turn("head", (1 - share) * vectors)

    def bend_spine(self, vectors: np.ndarray) -> None:
        """Bend the trunk by rotation vectors (T, 3) [rad], shared by its joints."""
        humanoid = self.character.humanoid
        joints = {humanoid[name]: name for name in ("spine", "chest", "upper_chest") if name in humanoid}
        joints.pop(humanoid.get("hips"), None)
        for name in joints.values():
            self.turn(name, vectors / len(joints))

    def clip(self, shape: np.ndarray | None = None, loop: bool = False) -> Clip:
        """The motion of all joints, with constant blend shape weights (B,)."""
        skeleton, facing = self.character.skeleton, self.character.facing
        bind = skeleton.bind[:, :3, 3]
        by_joint = {self.character.humanoid[n]: v for n, v in self._turns.items() if n != "root"}
        count = len(skeleton.names)
        turned = np.empty((count, len(self.times), 3, 3))
        placed = np.empty((count, len(self.times), 3))
        root = rotation.from_vector(self._turns["root"] @ facing)
        for joint, parent in enumerate(skeleton.parents):
            if parent < 0:
                turned[joint], placed[joint] = root, bind[joint] + self.position @ facing
            else:
                turned[joint] = turned[parent]
                placed[joint] = placed[parent] + turned[parent] @ (bind[joint] - bind[parent])
            if joint in by_joint:
                turned[joint] = turned[joint] @ rotation.from_vector(by_joint[joint] @ facing)
        joints = np.tile(np.eye(4), (len(self.times), count, 1, 1))
        joints[:, :, :3, :3] = turned.swapaxes(0, 1) @ skeleton.bind[:, :3, :3]
        joints[:, :, :3, 3] = placed.swapaxes(0, 1)
        weights = None if shape is None else np.tile(shape, (len(self.times), 1))
        return Clip(self.times, joints, weights, loop)

    def _hang_arm(self, side: str) -> None:
        """Turn the upper arm from the bind pose to hang at the body's side."""
        humanoid, bind = self.character.humanoid, self.character.skeleton.bind[:, :3, 3]
        arm, elbow = humanoid.get(f"{side}_upper_arm"), humanoid.get(f"{side}_lower_arm")
        if arm is None or elbow is None or np.allclose(bind[arm], bind[elbow]):
            return
        out = 0.2 if side == "left" else -0.2
        down = rotation.between(self.character.facing @ (bind[elbow] - bind[arm]), [out, -1.0, 0.03])
        self.turn(f"{side}_upper_arm", np.tile(rotation.to_vector(down), (len(self.times), 1)))


def ease(times: np.ndarray, start: float, duration: float) -> np.ndarray:
    """0 before `start`, 1 after `start + duration`, minimum jerk in between (Flash and Hogan 1985)."""
    s = np.clip((times - start) / max(duration, 1e-6), 0, 1)
    return s**3 * (10 - 15 * s + 6 * s**2)


def pulse(times: np.ndarray, start: float, attack: float, hold: float, release: float) -> np.ndarray:
    """0, up to 1 in `attack` from `start` on, held for `hold`, and down in `release` [s], all with minimum jerk; (T,)."""
    return ease(times, start, attack) - ease(times, start + attack + hold, release)


def travelled(times: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Distance travelled at a speed (T,) since the first sample, by the trapezoidal rule; (T,)."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(times))])


def swing(times: np.ndarray, start: float, cycles: float, rate: float) -> np.ndarray:
    """A sine of `cycles` at `rate` [Hz] from `start` [s] on, whose first and last half cycle fade in and out; (T,)."""
    end = start + cycles / rate
    fade = ease(times, start, 0.5 / rate) - ease(times, end - 0.5 / rate, 0.5 / rate)
    return fade * np.sin(2 * np.pi * rate * (times - start))


def leap(
    times: np.ndarray, start: float, height: float, deep: float, soft: float, down: float = 0.4, recover: float = 0.6
) -> tuple[np.ndarray, float]:
    """Height of the hips (T,) [m] through a jump, from crouch to standing again, and when it is over [s].

    Quintic from phase to phase, so smooth to the second derivative, and exactly ballistic in the air.

    Args:
        times: (T,) [s].
        start: when the crouch begins [s].
        height: of the flight [m].
        deep: how far the hips go down before the push [m].
        soft: how far they give way at landing [m].
        down: time of the crouch [s].
        recover: time to stand up again [s].
    """
    speed = np.sqrt(2 * G * height)
    phases = [down, 2.2 * deep / speed, 2 * speed / G, 2.2 * soft / speed, 0.04, recover]
    knots = start + np.cumsum([0, *phases])
    states = [  # height, speed, acceleration at each knot
        *[[0, 0, 0], [-deep, 0, 0], [0, speed, -G]],
        *[[0, -speed, -G], [-soft, 0, 0], [-soft, 0, 0], [0, 0, 0]],
    ]
    return BPoly.from_derivatives(knots, states)(np.clip(times, knots[0], knots[-1])), float(knots[-1])


def noise(times: np.ndarray, rng: np.random.Generator, highest: float) -> np.ndarray:
    """Smooth noise (T, 3) of about unit size: six sines up to `highest` [Hz], zero at the first sample."""
    rates = rng.uniform(0.15, highest, (6, 3))
    phases = rng.uniform(0, 2 * np.pi, (6, 3))
    waves = np.sin(2 * np.pi * rates * (times[:, None, None] - times[0]) + phases) / np.sqrt(3)
    waves = waves.sum(axis=1) / np.sqrt(2)
    return (waves - waves[0]) * ease(times, times[0], 0.6)[:, None]
