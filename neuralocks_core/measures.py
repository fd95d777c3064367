# SPDX-License-Identifier: Apache-2.0
"""Body shape as ten lengths that mean the same on every rig.

The paper conditions on the coefficients of its statistical body, which mean nothing on another body. Ten lengths
measured around the head in the bind pose tell the network the same: where head, neck, shoulders and back are. They are
measured on the character's own skin, not on what it wears.
"""

import numpy as np

from neuralocks_core.character import Character

MEASURES = (
    "head half width",
    "head height over its joint",
    "head front",
    "head back",
    "neck below head joint",
    "neck behind head joint",
    "upper arm half distance",
    "upper arm below head joint",
    "upper arm behind head joint",
    "back behind head joint",
)
AVERAGE = np.array([0.088, 0.152, 0.124, 0.091, 0.09, 0.02, 0.17, 0.20, 0.03, 0.111])
"""An average adult [m], for measures that a rig lacks; those of skin are the middle of what a network was trained on."""
LOWEST = np.array([0.075, 0.128, 0.103, 0.078, *[-np.inf] * 5, 0.092])
HIGHEST = np.array([0.101, 0.175, 0.145, 0.104, *[np.inf] * 5, 0.130])
"""A network reads measures [m] only between these bounds; it has not learned others.

They enclose `body_measures` of the body in `examples/shot` at 3,000 random shapes as `RolloutMaker` draws them (each weight
within -0.6 and 0.6), and at all corners of that range, rounded outward. Its shapes move no joints, so joints have no bounds:
an input that is constant throughout training has no weight in a network.
"""
TOLERATED = np.where(np.isfinite(HIGHEST - LOWEST), 0.5 * (HIGHEST - LOWEST), 0.03)
"""A measure that is farther than this outside the trained range [m] is reported: rigs place the joint of the same head a little
higher or lower, and that hardly shows in hair."""


def body_measures(character: Character, shape: np.ndarray | None = None) -> np.ndarray:
    """The ten MEASURES (10,) [m] of the bind pose with blend shape weights `shape` (B,), those of the face do not count."""
    result = AVERAGE.copy()
    joints = character.canonical(character.skeleton.bind[:, :3, 3])
    humanoid = character.humanoid
    if "neck" in humanoid:
        result[4:6] = -joints[humanoid["neck"], 1], -joints[humanoid["neck"], 2]
    if "left_upper_arm" in humanoid and "right_upper_arm" in humanoid:
        left, right = joints[humanoid["left_upper_arm"]], joints[humanoid["right_upper_arm"]]
        result[6:9] = (left[0] - right[0]) / 2, -(left[1] + right[1]) / 2, -(left[2] + right[2]) / 2
    if character.head_skin is not None:
        if shape is not None and np.any(shape):
            # A tongue that is out does not make a head deeper.
            shape = np.where(character.body_shapes, shape, 0)
        points = character.canonical(character.body.shaped(shape if np.any(shape) else None))
        head = points[character.head_skin]
        result[:4] = np.abs(head[:, 0]).max(), head[:, 1].max(), head[:, 2].max(), -head[:, 2].min()
        # The back at shoulder height, where long hair lies.
        level = (np.abs(points[:, 1] + result[7]) < 0.05) & (np.abs(points[:, 0]) < 0.5 * result[6])
        torso = level & ~character.on_head
        if torso.any():
            # There may be no skin below clothes.
            own = torso & character.skin
            result[9] = -points[own if own.any() else torso, 2].min()
    return result


def measures_read(character: Character, shape: np.ndarray | None = None) -> np.ndarray:
    """The measures (10,) [m] as a network reads them: those of `body_measures`, limited to the trained range."""
    return np.clip(body_measures(character, shape), LOWEST, HIGHEST)


def far_off(measures: np.ndarray, lowest: np.ndarray, highest: np.ndarray) -> list[int]:
    """Which of the measures (10,) are farther than TOLERATED outside the bounds (10,) [m], the farthest first."""
    outside = np.maximum(lowest - measures, measures - highest)
    return [int(i) for i in np.argsort(-outside) if outside[i] > TOLERATED[i]]


def another_body(character: Character, shape: np.ndarray, learned) -> str:
    """The measure in which a body differs most from those that a model has learned; "" if it differs by no more than TOLERATED, or
    has no skin to be measured.

    Args:
        character, shape: as for `body_measures`.
        learned: lowest and highest measures, as in a model's card, which comes from a file and may contain anything.
    """
    bounds = _bounds(learned)
    if bounds is None or character.head_skin is None:  # the network reads an average
        return ""
    lowest, highest = bounds
    measures = body_measures(character, shape)
    far = far_off(measures, lowest, highest)
    if not len(far):
        return ""
    worst = far[0]
    return f"{MEASURES[worst]} {measures[worst]:.3g} m (trained: {lowest[worst]:.3g} to {highest[worst]:.3g})"


def known_body(character: Character, shape: np.ndarray | None, learned) -> bool:
    """Whether a model's card tells its measures, and a body is like those; arguments are as for `another_body`."""
    return _bounds(learned) is not None and not another_body(character, shape, learned)


def _bounds(learned) -> tuple[np.ndarray, np.ndarray] | None:
    """Lowest and highest measures (10,) of a model's card; None where it tells none."""
    try:
        lowest, highest = (np.asarray(learned[name], float).reshape(len(MEASURES)) for name in ("lowest", "highest"))
    except (TypeError, KeyError, ValueError, OverflowError):
        return None
    return lowest, highest
