# SPDX-License-Identifier: Apache-2.0
"""The body close to hair: the head from a grid built once, the skin that moves relative to it posed in each frame."""

from functools import cached_property

import numpy as np
import scipy.sparse

from neuralocks_core.body.head_field import head_field
from neuralocks_core.body.moving_skin import SKIN, Box, PosedSkin
from neuralocks_core.native.body import Box as NativeBox
from neuralocks_core.native.keep_out import KeepOut
from neuralocks_core.rotation import transformed
from neuralocks_core.skinned_body import Body

HEAD = 1
CURVED = 0.004
"""How far skin may bend away from the plane of a nearby sample [m]."""
CLOSE = 0.9
"""How far a point's distance to the head is from that of the nearest node, at most, in cells."""


class NearBody:
    """The data that does not depend on the pose.

    Args:
        body: the part of the body that hair can reach, its points (V, 3) [m] in the bind pose.
        to_canonical: transform (4, 4) from the bind pose to canonical space.
        still: which vertices (V,) never move relative to the head.
        low, high: corners (3,) [m] of the space that hair can reach, canonical.
    """

    def __init__(self, body: Body, to_canonical: np.ndarray, still: np.ndarray, low: np.ndarray, high: np.ndarray):
        points = transformed(body.points, to_canonical)
        self.head = head_field(points, body.triangles, still)
        self.box = Box(low, high)
        self.marks = np.zeros(self.box.count, np.uint8)
        # A point is never farther than 1.8 node distances from the nearest node of its own cell.
        near = self.head.near(self.box.cell + 1.8 * self.head.cell)
        self.marks[self.box.cells(near[self.box.inside(near, 1)])] = HEAD
        self.skin = self.head.skin
        if self.skin:
            used, triangles = np.unique(self.head.moving, return_inverse=True)
            rows = np.repeat(np.arange(len(used)), body.joint_indices.shape[1])
            columns, weights = body.joint_indices[used].ravel(), body.joint_weights[used].ravel()
            count = int(body.joint_indices.max()) + 1
            self._weights = scipy.sparse.csr_array((weights, (rows, columns)), shape=(len(used), count))
            self._moving = body.part(used, triangles.reshape(-1, 3))

    def posed(self, skinning: np.ndarray, shape: np.ndarray | None, low: np.ndarray, high: np.ndarray) -> "PosedBody":
        """The body in a pose.

        Args:
            skinning: transforms (J, 4, 4) of each joint from the bind pose to canonical space.
            shape: change of the blend shape weights (B,) since the body's own.
            low, high: corners (3,) [m] of the space in which distances will be queried, canonical.
        """
        marks = self.marks.copy()
        if self.skin is None:
            return PosedBody(self, None, marks)
        points = self._moving.shaped(shape)
        blended = self._weights @ skinning[: self._weights.shape[1], :3].reshape(-1, 12)
        x, y, z = points.T[:, :, None]
        points = blended[:, 0::4] * x + blended[:, 1::4] * y + blended[:, 2::4] * z + blended[:, 3::4]
        return PosedBody(self, PosedSkin(self.skin, points, self.box, marks, low, high), marks)


class PosedBody:
    """The body in one pose, in canonical space; made by `NearBody.posed`."""

    def __init__(self, near: NearBody, skin: PosedSkin | None, marks: np.ndarray):
        self._near, self._skin, self._marks = near, skin, marks

    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed distance (...) [m], negative inside, and its direction (..., 3); infinite where nothing is near.

        Accurate to a few tenths of a millimetre near the skin, and smooth.
        """
        flat = np.asarray(points, np.float32).reshape(-1, 3)
        cells = self._near.box.cells(flat)
        marks = self._marks.take(cells)
        value, direction = np.full(len(flat), np.inf, np.float32), np.zeros(flat.shape, np.float32)
        rows = np.flatnonzero(marks & HEAD)
        value[rows], direction[rows] = self._near.head.distance(flat.take(rows, axis=0))
        if self._skin is not None:
            rows = np.flatnonzero(marks & SKIN)
            if len(rows):
                other, way = self._skin.distance(flat.take(rows, axis=0), cells.take(rows), value.take(rows))
                nearer = np.isfinite(other)
                value[rows[nearer]], direction[rows[nearer]] = other[nearer], way[nearer]
        return value.reshape(points.shape[:-1]), direction.reshape(points.shape)

    def compiled(self, vertices: int) -> KeepOut | None:
        """Compiled code on this body for strands of so many vertices, if there is some for them and for this machine."""
        neighbours = 0 if self._skin is None else self._skin.skin.near.shape[1]
        return self._compiled if KeepOut.serves(vertices, neighbours) else None

    @cached_property
    def _compiled(self) -> KeepOut:
        box, head, posed = NativeBox.of(self._near.box), self._near.head, self._skin
        fields = {
            "box": box, "marks": self._marks, "head_low": head.low, "head_per_cell": 1 / head.cell, "head_close": CLOSE * head.cell,
            "head_size": head.values.shape, "head_values": head.values,
        }  # fmt: skip
        if posed is not None:
            skin = posed.skin
            fields |= {
                "start": posed.start, "planes": posed.planes, "near": skin.near, "neighbours": skin.near.shape[1],
                "square": skin.square, "thick": skin.thick, "counted": skin.counted,
            }  # fmt: skip
        return KeepOut(fields)

    def violated(self, points: np.ndarray, low: np.ndarray) -> np.ndarray:
        """Numbers of the strands (n,) of points (S, K, 3) float32 with a vertex nearer than `low` (S, K) [m].

        One lookup in a grid clears most vertices.
        """
        each = points.shape[1]
        cells = self._near.box.cells(points).ravel()
        marks = self._marks.take(cells)
        rows = np.flatnonzero(marks)
        points, low = points.reshape(-1, 3).take(rows, axis=0), low.ravel().take(rows)
        marks, cells = marks.take(rows), cells.take(rows)
        close = (marks & HEAD).astype(bool)
        at = np.flatnonzero(close)
        close[at] = self._near.head.rough(points.take(at, axis=0)) < low.take(at) + np.float32(
            CLOSE * self._near.head.cell
        )
        if self._skin is not None:
            at = np.flatnonzero(marks & SKIN)
            close[at] |= self._skin.rough(points.take(at, axis=0), cells.take(at)) < low.take(at) + np.float32(CURVED)
        at = np.flatnonzero(close)
        inside = self.distance(points.take(at, axis=0))[0] < low.take(at)
        return np.unique(rows[at[inside]] // each)
