# SPDX-License-Identifier: Apache-2.0
"""Rotations of hair joints in a clip; each chain follows what carries it, the head or a bone of a hat in between."""

from dataclasses import replace

import numpy as np

from neuralocks_core.character import Character
from neuralocks_core.motion import Clip
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.network import RigModel, RigSampler
from neuralocks_core.rotation import angle_between, flat, rotation_part, volumes
from neuralocks_core.wind import Wind

TURNED = np.radians(0.5)
"""A carrier that never turns relative to the head by more than this [rad], and never shifts by more than `SHIFTED`, counts as one
with the head: files round."""
SHIFTED = 0.002
"""[m], see `TURNED`."""


class CarriedHair:
    """The turns of a model's joints on one character in one clip.

    A chain below a bone that moves relative to the head behaves as if that bone were the head: gravity, motion and neck are read
    as seen from it.

    Args:
        model: the network.
        joints: indices of its joints in the skeleton, (N,).
        character: skeleton and head.
        clip: its motion.

    Attributes:
        carriers: the joints that carry chains, ascending.
    """

    def __init__(self, model: RigModel, joints: np.ndarray, character: Character, clip: Clip):
        chains, above = model.chains, character.skeleton.parents[joints]
        apart = {int(joint) for joint in above[chains.roots] if _moves_apart(character, clip, int(joint))}
        carrier = np.array([above[root] if above[root] in apart else character.head for root in chains.roots])
        self.model, self.carriers = model, np.unique(carrier)
        self._parts = [
            (carrier[chains.chain] == one, RigSampler(model.spec, _carried_by(character, one), clip))
            for one in self.carriers
        ]

    def turns(
        self, times, strength: float = 1.0, joints: np.ndarray | None = None, wind: Wind | None = None
    ) -> np.ndarray:
        """Turns (n, N, 4) wxyz float32 in the model's bind axes; arguments and errors are those of `BoundarySampler.vectors`."""
        result = np.empty((np.size(times), len(self.model.chains), 4), np.float32)
        for rows, sampler in self._parts:
            result[:, rows] = self.model.evaluate(sampler.features(times, strength, joints, wind))[:, rows]
        return result


def moved_between(chains: HairChains, character: Character, clip: Clip) -> list[int]:
    """Joints between two of a chain, such as offsets, that turn or shift in a clip on what carries them, ascending. Hair moves with
    them besides its own turns, which know nothing of that.

    Args:
        chains: whose `joints` are those of the character.
        character: skeleton and head.
        clip: its motion.
    """
    above, found = character.skeleton.parents, set()
    for joint, parent in zip(chains.joints, chains.parents):
        up = int(above[joint])
        while parent >= 0 and up != chains.joints[parent]:
            found.add(up)
            up = int(above[up])
    return [joint for joint in sorted(found) if _moves_on(clip.joints[:, [above[joint], joint]])]


def _moves_on(joints: np.ndarray) -> bool:
    """Whether the second of two joints (T, 2, 4, 4) ever leaves its first place on the first; unknown without a readable rotation."""
    linear = joints[..., :3, :3]
    if flat(linear).any() or (volumes(linear) <= 0).any():
        return False
    local = np.linalg.inv(joints[:, 0]) @ joints[:, 1]
    turn = angle_between(rotation_part(local, "animation"), rotation_part(local[:1], "animation"))
    shift = np.linalg.norm(local[:, :3, 3] - local[0, :3, 3], axis=1)
    return bool(turn.max() > TURNED or shift.max() > SHIFTED)


def _carried_by(character: Character, joint: int) -> Character:
    return character if joint == character.head else replace(character, carrier=int(joint))


def _moves_apart(character: Character, clip: Clip, joint: int) -> bool:
    """Whether a joint is ever placed differently on the head than in the bind pose. A joint that a scale of zero hides, or that is
    mirrored, has no readable rotation; the head's is used.
    """
    linear = clip.joints[:, joint, :3, :3]
    if joint == character.head or flat(linear).any() or (volumes(linear) <= 0).any():
        return False
    head, own = character.carrying(clip.joints), _carried_by(character, joint).carrying(clip.joints)
    shift = clip.joints[:, joint, :3, 3] - (head @ character.skeleton.bind[joint, :, 3])[:, :3]
    turn = angle_between(rotation_part(head, "animation"), rotation_part(own, "animation"))
    return bool(turn.max() > TURNED or np.linalg.norm(shift, axis=1).max() > SHIFTED)
