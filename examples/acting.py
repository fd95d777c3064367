# SPDX-License-Identifier: Apache-2.0
"""The motion of the shipped shot: she walks in, turns to us, nods, shakes her head, jumps, stops and holds.

The motion is made of curves, without motion capture, so its licence is ours. Hips and head follow minimum-jerk curves, the feet
stay where they were put, and the legs follow from both.
"""

from dataclasses import dataclass

import numpy as np

from neuralocks_core import rotation
from neuralocks_core.animation.puppet import FRONT, SIDE, UP, Puppet, ease, leap, pulse, swing
from neuralocks_core.character import Character
from neuralocks_core.motion import Clip

SECONDS = 10.0
STEP = 0.54
"""[s] from one heel strike to the next."""
STRIDE = 0.64
"""[m] from one footprint to the next, of the other foot."""
HEADING = 0.5 * np.pi
"""[rad] She walks in towards +X and turns to face +Z."""
TURN = 2.75
NOD = 3.75
SHAKE = 4.65
JUMP = 5.85
HEIGHT = 0.26
"""[m] of the jump."""


@dataclass(frozen=True)
class Print:
    """A footprint: where a foot lands and when, and when it leaves again [m, s, rad]."""

    land: float
    lift: float
    place: np.ndarray
    yaw: float


def act(character: Character, rate: float = 24.0) -> Clip:
    """The shot's clip, `SECONDS` long at `rate` samples a second."""
    times = np.arange(round(SECONDS * rate) + 1) / rate
    puppet = Puppet(character, times)
    bind = character.skeleton.bind[:, :3, 3]
    hips = bind[character.humanoid["hips"]]
    prints, path, walking = _footprints(times, character)
    yaw = HEADING * (1 - ease(times, TURN, 0.75))
    phase = np.pi * times / STEP  # a stride (two steps) is one period; left heel strikes at even steps
    puppet.turn("root", yaw[:, None] * UP)
    rise, _ = leap(times, JUMP, HEIGHT, 0.2, 0.17)
    bob = walking * (0.018 * np.cos(2 * phase + np.pi - 0.7) - 0.014)
    puppet.position += path + (bob + rise - 0.012)[:, None] * UP
    # The root turns about its own joint on the floor, which is below the hips only at rest.
    sway = walking * 0.022 * np.cos(phase - 0.4)
    puppet.position += sway[:, None] * (SIDE[None] * np.cos(yaw)[:, None] - FRONT[None] * np.sin(yaw)[:, None])
    crouch = 0.5 * (np.sqrt(rise**2 + 0.08**2) - rise) - 0.04  # no kink as the feet leave
    twist = walking * 0.1 * np.cos(phase + np.pi)
    pelvis = twist[:, None] * UP + (0.9 * crouch)[:, None] * SIDE + (walking * 0.03 * np.sin(phase))[:, None] * FRONT
    puppet.turn("hips", pelvis)
    lag = yaw - HEADING * (1 - ease(times, TURN - 0.12, 0.75))  # shoulders and head lead the turn
    puppet.bend_spine((-1.8 * twist - 0.5 * lag)[:, None] * UP)
    puppet.bend_spine((0.05 * walking + 1.1 * crouch)[:, None] * SIDE)
    _head(puppet, times, twist, lag, crouch)
    _arms(puppet, times, walking, phase)
    _legs(puppet, prints, hips, pelvis, yaw, rise)
    return puppet.clip()


def _head(puppet, times, twist, lag, crouch):
    puppet.turn_neck((0.8 * twist - 0.9 * lag)[:, None] * UP - (1.3 * crouch)[:, None] * SIDE)
    puppet.turn_neck(pulse(times, 0.55, 0.5, 0.5, 0.5)[:, None] * UP * -0.35)  # a glance at us while walking
    nod = 0.33 * swing(times, NOD, 2.0, 1.9) + 0.1 * pulse(times, NOD, 0.3, 0.4, 0.3)
    puppet.turn_neck(nod[:, None] * SIDE)
    puppet.turn_neck(swing(times, SHAKE, 2.5, 2.1)[:, None] * UP * 0.6)
    puppet.bend_spine(swing(times, SHAKE, 2.5, 2.1)[:, None] * UP * -0.06)
    # At the end she looks aside, a little down, and holds it.
    end = ease(times, JUMP + 1.1, 0.4)[:, None]
    puppet.turn_neck(end * (UP * 0.22 + SIDE * 0.06 + FRONT * 0.12))


def _arms(puppet, times, walking, phase):
    back = pulse(times, JUMP - 0.1, 0.4, 0.0, 0.16)
    up = pulse(times, JUMP + 0.36, 0.24, 0.12, 0.5)
    bind, humanoid = puppet.character.skeleton.bind[:, :3, 3], puppet.character.humanoid
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder, elbow, hand = (bind[humanoid[f"{side}_{part}"]] for part in ("upper_arm", "lower_arm", "hand"))
        hinge = np.cross(elbow - shoulder, hand - elbow)
        hinge /= np.linalg.norm(hinge)
        arm = walking * 0.4 * np.cos(phase) * sign
        puppet.turn_further(f"{side}_upper_arm", (arm + 0.6 * back - 1.3 * up)[:, None] * SIDE)
        puppet.turn_further(f"{side}_upper_arm", (0.15 * up * sign)[:, None] * FRONT)
        # The elbow is bent more in the bind pose than in a hanging arm.
        bend = -0.42 + walking * (0.15 - 0.45 * arm) + 0.3 * back + 0.3 * up
        puppet.turn(f"{side}_lower_arm", bend[:, None] * hinge)


def _footprints(times, character):
    """Footprints per side, path of the body over the floor (T, 3) [m], and how much she walks (T,) 0..1."""
    ankle = {s: character.skeleton.bind[character.humanoid[f"{s}_foot"], :3, 3] for s in ("left", "right")}
    last = 4  # steps 0 .. last strike ahead of the hips, one more closes the stance
    stop = (last + 0.35) * STEP
    speed = STRIDE / STEP
    slow = 0.9
    # Constant speed, then a minimum-jerk stop: braking covers half the distance that full speed would have covered.
    u = np.clip((times - stop + slow / 2) / slow, 0, 1)
    way = speed * (np.minimum(times, stop - slow / 2) + slow * (u - u**4 * (2.5 - 3 * u + u**2)))
    end = speed * (stop - slow / 2) + speed * slow * 0.5
    direction = np.array([np.sin(HEADING), 0, np.cos(HEADING)])
    path = (way - end)[:, None] * direction
    walking = 1 - ease(times, stop - slow / 2, slow)
    prints = {"left": [], "right": []}

    def put(side, land, lift, ahead, yaw, base):
        out = np.array([np.cos(yaw), 0, -np.sin(yaw)]) * ankle[side][0] * (0.55 if ahead is not None else 0.8)
        forward = np.array([np.sin(yaw), 0, np.cos(yaw)])
        prints[side].append(Print(land, lift, base + out + (0 if ahead is None else ahead) * forward, yaw))

    for k in range(-2, last + 1):
        side = "left" if k % 2 == 0 else "right"
        reach = min(speed * k * STEP + 0.3, end + 0.1)
        lift = (k + 1) * STEP + 0.12
        if k == last:
            lift = TURN + 0.5
        put(side, k * STEP, lift, reach - end, HEADING, np.zeros(3))
    closing = "left" if (last + 1) % 2 == 0 else "right"
    put(closing, (last + 1) * STEP, TURN + 0.1, 0.0, HEADING, np.zeros(3))
    # The turn: first the foot on the turning side opens, then the other follows.
    put(closing, TURN + 0.48, 1e9, None, 0.0, np.zeros(3))
    opened = "left" if closing == "right" else "right"
    put(opened, TURN + 0.92, 1e9, None, 0.0, np.zeros(3))
    return prints, path, walking


def _foot_curve(prints, times, rise, height):
    """Ankle positions (T, 3), yaw (T,) and pitch, toes down, (T,) of one foot."""
    place = np.tile(prints[0].place, (len(times), 1))
    yaw = np.full(len(times), prints[0].yaw)
    pitch = np.zeros(len(times))
    lifted = np.zeros(len(times))
    for before, after in zip(prints[:-1], prints[1:]):
        share = ease(times, before.lift, after.land - before.lift)
        place += share[:, None] * (after.place - before.place)
        yaw += share * (after.yaw - before.yaw)
        length = np.linalg.norm(after.place - before.place)
        s = np.clip((times - before.lift) / (after.land - before.lift), 0, 1)
        walk = np.clip(length / STRIDE, 0.25, 1)
        lifted += 0.07 * walk * np.sin(np.pi * s) ** 2
        # The heel leaves before the foot does, and the foot lands on its heel.
        lead = pulse(times, before.lift - 0.22, 0.24, 0.0, 0.3) * 0.55 * walk**2
        heel = pulse(times, after.land - 0.2, 0.17, 0.0, 0.14) * 0.22 * walk**2
        pitch += lead - heel
    air = np.clip(rise, 0, None)
    pitch += 0.55 * np.clip(air / 0.1, 0, 1)
    # Pitching about the ball of the foot lifts the ankle.
    toes = np.clip(pitch, 0, None)
    place[:, 1] = height + lifted + air + 0.13 * np.sin(toes) + 0.02 * np.sin(np.clip(-pitch, 0, None))
    place += (0.13 * (1 - np.cos(toes)))[:, None] * _ahead(yaw)
    return place, yaw, pitch


def _ahead(yaw):
    return np.stack([np.sin(yaw), np.zeros_like(yaw), np.cos(yaw)], axis=-1)


def _legs(puppet, prints, hips, pelvis, yaw, rise):
    """Turn thighs, shins and feet so that the ankles go where the footprints need them."""
    character = puppet.character
    bind, humanoid = character.skeleton.bind[:, :3, 3], character.humanoid
    root = rotation.from_vector(yaw[:, None] * UP)
    trunk = root @ rotation.from_vector(pelvis)
    centre = puppet.position + bind[0] + root @ (hips - bind[0])
    for side in ("left", "right"):
        thigh, shin, foot = (bind[humanoid[f"{side}_{part}"]] for part in ("upper_leg", "lower_leg", "foot"))
        socket = centre + trunk @ (thigh - hips)
        ankle, foot_yaw, pitch = _foot_curve(prints[side], puppet.times, rise, foot[1])
        straight = ankle - socket
        upper, lower = np.linalg.norm(shin - thigh), np.linalg.norm(foot - shin)
        distance = np.minimum(np.linalg.norm(straight, axis=1), 0.998 * (upper + lower))
        axis = straight / np.linalg.norm(straight, axis=1, keepdims=True)
        side_axis = _cross_of(0.5 * (yaw + foot_yaw))
        side_axis -= np.sum(side_axis * axis, axis=1, keepdims=True) * axis
        side_axis /= np.linalg.norm(side_axis, axis=1, keepdims=True)
        cosine = (upper**2 + distance**2 - lower**2) / (2 * upper * distance)
        sine = np.sqrt(np.clip(1 - cosine**2, 0, None))
        knee = socket + upper * (cosine[:, None] * axis + sine[:, None] * np.cross(axis, side_axis))
        turned_thigh = _swung(knee - socket, side_axis, shin - thigh)
        turned_shin = _swung(socket + distance[:, None] * axis - knee, side_axis, foot - shin)
        turned_foot = rotation.from_vector(foot_yaw[:, None] * UP) @ rotation.from_vector(pitch[:, None] * SIDE)
        for name, parent, child in (
            ("upper_leg", trunk, turned_thigh),
            ("lower_leg", turned_thigh, turned_shin),
            ("foot", turned_shin, turned_foot),
        ):
            puppet.turn(f"{side}_{name}", rotation.to_vector(np.swapaxes(parent, -1, -2) @ child))


def _cross_of(yaw):
    return np.stack([np.cos(yaw), np.zeros_like(yaw), -np.sin(yaw)], axis=-1)


def _swung(direction, side_axis, bind_direction):
    """Rotations (T, 3, 3) that take a bone of the bind pose to `direction`, its hinge to `side_axis`."""
    return _frame(direction, side_axis) @ np.swapaxes(_frame(bind_direction, SIDE), -1, -2)


def _frame(direction, side):
    first = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    second = side - np.sum(side * first, axis=-1, keepdims=True) * first
    second = second / np.linalg.norm(second, axis=-1, keepdims=True)
    return np.stack([first, second, np.cross(first, second)], axis=-1)
