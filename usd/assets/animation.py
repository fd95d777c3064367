# SPDX-License-Identifier: Apache-2.0
"""Write a clip as a UsdSkel animation."""

import numpy as np
from pxr import Gf, Usd, UsdSkel, Vt

from neuralocks_core import rotation
from neuralocks_core.character import Character
from neuralocks_core.motion import Clip

from ..border.arrays import quaternions, vectors
from ..border.units import Border


def write_animation(stage: Usd.Stage, path: str, character: Character, clip: Clip) -> UsdSkel.Animation:
    """Author a clip of a character on a stage as joint samples, one per clip time; clip time zero is time code 1.

    Joint scales stay at one. The skeleton is assumed to stand at the stage's origin.

    Args:
        stage: its unit, up axis and rate are honoured.
        path: prim path of the animation.
        character: whose joints are written; the skeleton prim must have the same joint paths.
        clip: what to write.
    """
    border = Border.of(stage)
    world = border.from_core @ clip.joints
    # A joint's own axes keep unit length in the stage's unit; only its position is scaled.
    world[..., :3, :3] = rotation.rotation_part(world, path)
    local = rotation.relative_to_parents(world, character.skeleton.parents)
    turns = rotation.continuous(rotation.to_quaternion(local[..., :3, :3]))
    places = local[..., :3, 3]
    animation = UsdSkel.Animation.Define(stage, path)
    animation.CreateJointsAttr(list(character.skeleton.names))
    animation.CreateScalesAttr(Vt.Vec3hArray([Gf.Vec3h(1)] * len(character.skeleton.names)))
    codes = 1.0 + clip.times * border.rate
    _samples(animation.CreateRotationsAttr(), codes, turns, quaternions)
    _samples(animation.CreateTranslationsAttr(), codes, places, vectors)
    return animation


def _samples(attribute, codes, values, pack):
    if np.ptp(values, axis=0).max(initial=0) < 1e-7:
        attribute.Set(pack(values[0]))
        return
    for code, value in zip(codes, values):
        attribute.Set(pack(value), float(code))
