# SPDX-License-Identifier: GPL-3.0-or-later
"""An armature object: rest pose, and the evaluated pose of any depsgraph."""

import numpy as np

from ...services.rigs import names
from ...services.rigs.rig import RigArrays
from ..files.paths import check_found
from .skinned import bones_with_skin


def matrix(value) -> np.ndarray:
    """A Blender matrix as (4, 4) float64."""
    # Row by row: numpy would query a whole matrix for its shape value by value.
    return np.array([row[:] for row in value])


def read(armature, head_bone: str = "") -> RigArrays:
    """The rest pose, bones ordered parents first.

    Raises:
        NeuralocksError: the armature is from a library that was not found.
    """
    check_found(armature)
    bones = armature.data.bones
    index = {bone.name: i for i, bone in enumerate(bones)}
    parents = [index[bone.parent.name] if bone.parent else -1 for bone in bones]
    order = names.parents_first(parents)
    place = np.empty(len(order), int)
    place[order] = np.arange(len(order))
    rest = np.empty((len(bones), 4, 4), np.float32)
    if len(bones):
        bones.foreach_get("matrix_local", rest.ravel())
    return RigArrays(
        armature.name_full,
        tuple(bones[i].name for i in order),
        np.array([place[parents[i]] if parents[i] >= 0 else -1 for i in order], int),
        rest.astype(float).swapaxes(1, 2)[order],
        head_bone,
        np.isin([bones[i].name for i in order], list(bones_with_skin(armature))),
    )


class PoseReader:
    """Reads world transforms of all joints of one armature, fast and in the order of its `RigArrays`.

    Attributes:
        bones: names in the armature's own order.
    """

    def __init__(self, armature, bones: tuple[str, ...]):
        self.bones = tuple(armature.pose.bones.keys())
        pose = {name: i for i, name in enumerate(self.bones)}
        self._order = np.array([pose[name] for name in bones], int)
        self._buffer = np.empty((len(pose), 4, 4), np.float32)

    def world(self, evaluated) -> np.ndarray:
        """(J, 4, 4) in Blender's world space, of an evaluated armature object."""
        evaluated.pose.bones.foreach_get("matrix", self._buffer.ravel())
        return self.posed(self._buffer, matrix(evaluated.matrix_world))

    def record(self, evaluated, pose: np.ndarray, basis: np.ndarray) -> None:
        """Fill two arrays (B, 4, 4) float32, this frame's in a block of frames, for `posed` and `own`, which take a fraction of the
        time for many frames together.
        """
        evaluated.pose.bones.foreach_get("matrix", pose.ravel())
        evaluated.pose.bones.foreach_get("matrix_basis", basis.ravel())

    def posed(self, pose: np.ndarray, place: np.ndarray) -> np.ndarray:
        """(..., J, 4, 4) in Blender's world space, from poses (..., B, 4, 4) of armatures that stand at `place` (..., 4, 4)."""
        return place[..., None, :, :] @ pose.astype(float).swapaxes(-1, -2)[..., self._order, :, :]

    def own(self, basis: np.ndarray) -> np.ndarray:
        """Rotation and scale from the bones' own channels, without constraints, (..., J, 3, 3) in their rest axes."""
        return basis.swapaxes(-1, -2)[..., self._order, :3, :3]
