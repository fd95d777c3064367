# SPDX-License-Identifier: Apache-2.0
"""One person in several skeletons, such as a face, a body and clothes: hair is kept out of the meshes of all of them."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.character import Character
from neuralocks_core.skinned_body import Body

from ...skel.stage_rig import StageRig
from ..carriers.attach import Attachment
from ..carriers.twin_bodies import SAME, one_person

PROBES = 5
"""Times at which joints of two skeletons are compared, evenly over the animation."""
ARM = 0.1
"""Distance from a joint [m] at which its counterpart must move alike, too."""
CARRIED = 0.5
"""Skin with less of its weights on joints that have a counterpart is left out."""


class WholeBodies:
    """The whole bodies of a stage's characters, each put together once.

    Args:
        rigs: all skeletons of the stage.
    """

    def __init__(self, rigs: Iterable[StageRig]):
        self._rigs = rigs
        self._bodies: dict[str, tuple[Body | None, list[str]]] = {}
        self._characters: dict[Character, Character] = {}

    def of(self, rig: StageRig) -> tuple[Body | None, list[str]]:
        """The `whole_body` of a skeleton."""
        if rig.path not in self._bodies:
            self._bodies[rig.path] = whole_body(rig, self._rigs)
        return self._bodies[rig.path]

    def on(self, found: Attachment) -> Attachment:
        """What carries a groom, on its whole body; grooms that share a character still do."""
        body, own = self.of(found.rig)[0], found.character
        if body is found.rig.character.body:
            return found
        if own not in self._characters:
            self._characters[own] = replace(own, body=body)
        return replace(found, character=self._characters[own])


def whole_body(rig: StageRig, rigs: Iterable[StageRig]) -> tuple[Body | None, list[str]]:
    """The body of a character with the meshes that its other skeletons skin, as far as joints of this one move like theirs; and the
    paths of those of which it can carry nothing.

    Args:
        rig: the skeleton that carries the hair.
        rigs: all skeletons of the stage.
    """
    parts, left = parts_elsewhere(rig, rigs)
    return with_parts(rig.character.body, parts), left


def with_parts(own: Body | None, parts: Sequence[Body]) -> Body | None:
    """A body, or none, followed by parts of it; itself if there are no parts."""
    return Body.joined([*([] if own is None else [own]), *parts]) if parts else own


def parts_elsewhere(rig: StageRig, rigs: Iterable[StageRig]) -> tuple[list[Body], list[str]]:
    """What `whole_body` adds, in bind world and at rest: blend shapes of other skeletons are left out."""
    found, left = [], []
    for other in rigs:
        if other.path != rig.path and other.character.body is not None and one_person(rig, other):
            part = _carried(other.character.body, _counterparts(rig, other))
            if part is None:
                left.append(other.path)
            else:
                found.append(part)
    return found, left


def _carried(body: Body, counterparts: np.ndarray) -> Body | None:
    """A body on other joints, those of `counterparts` (J,), -1 for none; None if no triangle is left."""
    joints = counterparts[body.joint_indices]
    weights = np.where(joints >= 0, body.joint_weights, 0.0)
    share = weights.sum(axis=1)
    kept = share > CARRIED
    faces = body.triangles[kept[body.triangles].all(axis=1)]
    if not len(faces):
        return None
    weights /= np.maximum(share, CARRIED)[:, None]
    return Body(body.points, body.triangles, np.maximum(joints, 0), weights).only(faces)


def _counterparts(rig: StageRig, other: StageRig) -> np.ndarray:
    """For each joint of `other` the joint of `rig` that moves alike (J,): the one of that name, or else the one of its parent, as a
    twist joint has; -1 for none.
    """
    names = [leaf(name) for name in rig.character.skeleton.names]
    own = {name: joint for joint, name in enumerate(names) if names.count(name) == 1}
    times = np.linspace(*rig.clip.times[[0, -1]], PROBES)
    moves = [each.clip.at(times) @ each.character.inverse_bind for each in (rig, other)]
    skeleton = other.character.skeleton
    result = np.full(len(skeleton.names), -1)
    for joint, (name, parent) in enumerate(zip(skeleton.names, skeleton.parents)):
        place = skeleton.bind[joint, :3, 3]

        def alike(candidate: int, points: np.ndarray, joint: int = joint) -> bool:
            apart = moves[0][:, candidate, :3] - moves[1][:, joint, :3]
            return bool(np.abs(np.einsum("tij,nj->tni", apart[..., :3], points) + apart[:, None, :, 3]).max() < SAME)

        same = own.get(leaf(name), -1)
        if same >= 0 and np.abs(rig.character.skeleton.bind[same, :3, 3] - place).max() < SAME:
            if alike(same, place + ARM * np.concatenate([np.zeros((1, 3)), np.eye(3)])):
                result[joint] = same
        elif parent >= 0 and result[parent] >= 0 and alike(result[parent], place[None]):
            result[joint] = result[parent]
    return result
