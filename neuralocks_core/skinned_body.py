# SPDX-License-Identifier: Apache-2.0
"""The surface of a character, or one mesh of it, which joints and blend shapes move."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

LEAST_WEIGHT = 1e-3
"""Skin weight below which a joint does not drive a vertex."""


@dataclass(frozen=True, eq=False)
class Body:
    """Skinned triangle mesh in bind pose.

    Attributes:
        points: (V, 3) [m], world space of the bind pose.
        triangles: (F, 3) int, outward by the right-hand rule.
        joint_indices: (V, I) int.
        joint_weights: (V, I), each row sums to one.
        shapes: blend shape name -> offsets (V, 3) [m].
    """

    points: np.ndarray
    triangles: np.ndarray
    joint_indices: np.ndarray
    joint_weights: np.ndarray
    shapes: dict[str, np.ndarray] = field(default_factory=dict)

    @classmethod
    def joined(cls, parts: Sequence["Body"]) -> "Body | None":
        """Several bodies as one, in which shapes with the same name become one shape; None if there are none."""
        if not parts:
            return None
        ends = np.cumsum([0] + [len(part.points) for part in parts])
        width, shapes = max(part.joint_indices.shape[1] for part in parts), {}
        wider = [((0, 0), (0, width - part.joint_indices.shape[1])) for part in parts]
        for part, start, end in zip(parts, ends, ends[1:]):
            for name, offsets in part.shapes.items():
                shapes.setdefault(name, np.zeros((ends[-1], 3)))[start:end] = offsets
        return cls(
            np.concatenate([part.points for part in parts]),
            np.concatenate([part.triangles + start for part, start in zip(parts, ends)]),
            np.concatenate([np.pad(part.joint_indices, by) for part, by in zip(parts, wider)]),
            np.concatenate([np.pad(part.joint_weights, by) for part, by in zip(parts, wider)]),
            shapes,
        )

    def part(self, vertices: np.ndarray, triangles: np.ndarray) -> "Body":
        """Some of the vertices (v,), with triangles (f, 3) whose corners are indices into these."""
        return Body(
            self.points[vertices],
            triangles,
            self.joint_indices[vertices],
            self.joint_weights[vertices],
            {name: offsets[vertices] for name, offsets in self.shapes.items()},
        )

    def only(self, triangles: np.ndarray) -> "Body":
        """Some of the triangles (f, 3), with their corners alone."""
        used, own = np.unique(triangles, return_inverse=True)
        return self.part(used, own.reshape(-1, 3))

    def shaped(self, weights: np.ndarray | None = None) -> np.ndarray:
        """Bind-pose points (V, 3) with blend shape weights (B,), in the order of `shapes`; None means zeros."""
        points = self.points
        for offsets, weight in zip(self.shapes.values(), () if weights is None else weights):
            if weight:  # a face has hundreds, of which a frame uses a few
                points = points + weight * offsets
        return points

    def posed(self, skinning: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
        """World points (V, 3) by linear blend skinning; `skinning` (J, 4, 4) are posed @ inverse(bind) transforms."""
        points = self.shaped(weights)
        blended = np.einsum("vi,vixy->vxy", self.joint_weights, skinning[self.joint_indices, :3])
        return np.einsum("vxy,vy->vx", blended[:, :, :3], points) + blended[:, :, 3]

    def weight_on(self, joints: np.ndarray) -> np.ndarray:
        """Sum of each vertex's weights (V,) on the joints of a mask (J,)."""
        return np.sum(self.joint_weights * joints[self.joint_indices], axis=1)

    def driven_by(self, joint_count: int) -> np.ndarray:
        """Which joints (J,) drive any of its vertices."""
        used = np.zeros(joint_count, bool)
        used[self.joint_indices[self.joint_weights > LEAST_WEIGHT]] = True
        return used
