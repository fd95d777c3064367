# SPDX-License-Identifier: Apache-2.0
"""The part of a body that hair can touch, coarse enough to be posed for every frame of thousands of clips."""

from __future__ import annotations

import numpy as np

from neuralocks_core.character import Character
from neuralocks_core.mesh import vertex_normals
from neuralocks_core.rotation import unit
from neuralocks_core.skinned_body import Body

CELL = 0.012
"""[m] Vertices within one cell of this size become one; at a head's curvature, this moves the surface by 0.2 mm."""
FLAT = 0.5
"""Cosine between a vertex's normal and its cell's mean normal; if one is below this, all vertices of the cell stay."""


def hair_body(character: Character, reach: float) -> Body | None:
    """The body from the top of the head down to `reach` [m] under the head joint, arms to the elbow.

    Every vertex kept is one of the body's own, so its skinning weights and blend shapes stay valid.
    """
    body = character.body
    if body is None:
        return None
    points = character.canonical(body.points)
    near = (points[:, 1] > -reach) & (np.abs(points[:, 0]) < 0.45)
    faces = body.triangles[near[body.triangles].all(axis=1)]
    used = np.unique(faces)
    if not len(used):
        return None
    # Cells are split by the joint that moves a vertex most, or an arm would be welded to the ribs beside it.
    main = body.joint_indices[np.arange(len(points)), body.joint_weights.argmax(axis=1)]
    key = np.column_stack([np.floor(points[used] / CELL).astype(np.int64), main[used]])
    _, group = np.unique(key, axis=0, return_inverse=True)
    group = _parted(group.ravel(), vertex_normals(points, faces)[used])
    size = np.bincount(group)
    middle = np.stack([np.bincount(group, points[used, axis]) for axis in range(3)], axis=1) / size[:, None]
    order = np.lexsort([np.linalg.norm(points[used] - middle[group], axis=1), group])
    keeper = used[order[np.unique(group[order], return_index=True)[1]]]
    new = np.full(len(points), -1)
    new[used] = group
    faces = new[faces]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    coarse = body.part(keeper, _without_flaps(faces[whole]))
    return coarse.only(coarse.triangles)


def _without_flaps(faces: np.ndarray) -> np.ndarray:
    """Triangles (F, 3) without those that lie back to back on the same corners: between them is nothing, beside them either side is
    outside and inside, and a corner of no others has no normal.
    """
    first = np.argmin(faces, axis=1)[:, None]
    turned = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1)
    way = np.where(turned[:, 1] < turned[:, 2], 1, -1)
    _, same = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True)
    return faces[np.bincount(same.ravel(), way)[same.ravel()] != 0]


def _parted(group: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Groups (V,) int that do not mix vertices of opposite sides, from groups (V,) and normals (V, 3).

    If an ear's two sides are welded into one sheet, it has no inside or outside: hair 8 cm away is pulled in.
    """
    mean = unit(np.stack([np.bincount(group, part) for part in normals.T], axis=1))
    flattest = np.full(len(mean), np.inf)
    np.minimum.at(flattest, group, (normals * mean[group]).sum(axis=1))
    alone = flattest[group] < FLAT
    return np.unique(np.where(alone, len(mean) + np.arange(len(group)), group), return_inverse=True)[1].ravel()


def posed_over_time(body: Body, skinning: np.ndarray, shape: np.ndarray | None = None) -> np.ndarray:
    """World points (T, V, 3) float32 for skinning transforms (T, J, 4, 4): one matrix product for all frames."""
    joints, local = np.unique(body.joint_indices, return_inverse=True)
    weights = np.zeros((len(body.points), len(joints)), np.float32)
    np.add.at(
        weights,
        (np.arange(len(weights))[:, None], local.reshape(body.joint_indices.shape)),
        body.joint_weights,
    )
    rows = skinning[:, joints, :3].astype(np.float32)
    blended = weights @ rows.transpose(1, 0, 2, 3).reshape(len(joints), -1)
    blended = blended.reshape(len(weights), len(skinning), 3, 4)
    points = body.shaped(shape).astype(np.float32)
    return (np.einsum("vtij,vj->tvi", blended[..., :3], points) + blended[..., 3].transpose(1, 0, 2)).copy()
