# SPDX-License-Identifier: Apache-2.0
"""A captured skeleton and its motion, turned so that Y is up and the rest pose stands."""

from dataclasses import dataclass

import numpy as np

from neuralocks_core import rotation
from neuralocks_core.anatomy.humanoid import Humanoid
from neuralocks_core.anatomy.rest_from_motion import rest_from_motion
from neuralocks_core.anatomy.standing import FEET, lies

AXES = {"Y": np.array([0.0, 1, 0]), "Z": np.array([0.0, 0, 1])}
"""The up directions that files use."""
UPRIGHT = np.cos(np.radians(60))
"""A trunk stands along Y if it is closer to Y than this, since limbs may point anywhere at rest; legs that point up never stand."""
ALONG = np.cos(np.radians(30))
"""The same for other axes, where both legs and trunk count."""
MOSTLY = np.cos(np.radians(45))
"""A pose stands along an axis if its line from feet to head is closer to the axis than this."""
SELDOM = 0.02
"""The share of poses that may stand along an axis by chance."""
POSES = 200
"""Number of poses of a motion that are examined."""


@dataclass(frozen=True, eq=False)
class Upright:
    """What `upright` found.

    Attributes:
        rest: world transforms (J, 4, 4) of a standing pose, Y up.
        world: world transforms of the motion (T, J, 4, 4), Y up.
        up: 'Y' or 'Z', which of the file's axes was up.
        guessed: whether `rest` is taken from the motion, because the file's own rest pose does not stand.
    """

    rest: np.ndarray
    world: np.ndarray
    up: str
    guessed: bool


def upright(rest: np.ndarray, world: np.ndarray, parents, humanoid: Humanoid) -> Upright:
    """Turn a rest pose (J, 4, 4) and a motion (T, J, 4, 4); both are returned unchanged if the rest pose stands along Y.

    Args:
        rest: world transforms of the rest pose.
        world: world transforms of the motion, not empty.
        parents: (J,) parent indices, -1 for roots.
        humanoid: which joints are which.
    """
    stands = standing_axis(rest[:, :3, 3], humanoid)
    if stands is not None and stands[1] == 1:
        return Upright(rest, world, "Y", False)
    up = _up_in_motion(world, humanoid, stands)
    if up != "Y":
        world = _turned(world, AXES[up])
    if stands is not None:
        return Upright(_turned(rest, stands), world, up, False)
    found = rest_from_motion(_some(world), parents, humanoid)
    return Upright(rest if found is None else found, world, up, True)


def mostly_lies(world: np.ndarray, humanoid: Humanoid) -> bool:
    """Whether a motion, world transforms (T, J, 4, 4), Y up, shows a body that lies down in more than half of its poses."""
    return bool(np.mean([lies(pose[:, :3, 3], humanoid, AXES["Y"])[0] for pose in _some(world)]) > 0.5)


def standing_axis(places: np.ndarray, humanoid: Humanoid) -> np.ndarray | None:
    """Axis (3,) along which a rest pose, joint positions (J, 3), stands; Y for a head alone; None if it stands along none."""
    trunk = rotation.unit(places[humanoid["head"]] - places[humanoid["hips"]])
    feet = [humanoid[name] for name in FEET if name in humanoid]
    legs = rotation.unit(places[humanoid["hips"]] - places[feet])  # each, as one may go up and the other down
    if not trunk.any() or trunk[1] > UPRIGHT and (legs[:, 1] > -UPRIGHT).all():
        return AXES["Y"]
    for axis in np.concatenate([np.eye(3), -np.eye(3)]):
        if feet and trunk @ axis > ALONG and (legs @ axis > ALONG).all():
            return axis
    return None


def _up_in_motion(world: np.ndarray, humanoid: Humanoid, stands: np.ndarray | None) -> str:
    """The up axis: that of the rest pose if the body ever stands along it, else the one along which it mostly stands, else Y."""
    places = world[:, :, :3, 3]
    feet = [places[:, humanoid[name]] for name in FEET if name in humanoid]
    low = np.mean(feet, axis=0) if feet else places[:, humanoid["hips"]]
    body = rotation.unit(places[:, humanoid["head"]] - low)
    if stands is not None and stands[2] == 1 and (body[:, 2] > MOSTLY).mean() > SELDOM:
        return "Z"
    middle = np.median(body, axis=0)
    return next((name for name, axis in AXES.items() if middle @ axis > MOSTLY), "Y")


def _some(world: np.ndarray) -> np.ndarray:
    """At most POSES of a motion's poses, evenly spread over it."""
    return world[np.linspace(0, len(world) - 1, min(POSES, len(world))).astype(int)]


def _turned(transforms: np.ndarray, up: np.ndarray) -> np.ndarray:
    """World transforms (..., 4, 4) turned as a whole by quarter turns, so that an axis (3,) of theirs becomes Y."""
    turn = np.eye(4)
    turn[:3, :3] = rotation.between(up, AXES["Y"]).round()
    return turn @ transforms
