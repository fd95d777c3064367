# SPDX-License-Identifier: Apache-2.0
"""Mirrored hair and motion: bodies are alike on both sides, so each rollout is worth two.

Without it, a network learns turns to the left and to the right separately, and treats them differently.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.strands.strand_set import StrandSet, root_frames, root_uv

POLAR = np.array([-1.0, 1.0, 1.0], np.float32)
"""Effect of the mirror, canonical x = 0, on positions, directions and accelerations (3,)."""
AXIAL = -POLAR
"""Its effect on angular velocities (3,)."""


def mirrored_strands(strands: StrandSet) -> StrandSet:
    """The strands of the other side; order and locks are unchanged."""
    rest, centre = strands.rest * POLAR, strands.head_centre * POLAR
    normal = (strands.root_normal * POLAR).astype(np.float64)
    return replace(
        strands,
        rest=rest,
        uv=root_uv(rest[:, 0], centre),
        root_frame=root_frames(normal).astype(np.float32),
        head_centre=centre,
    )


def mirrored_vectors(spec: BoundarySpec, vectors: np.ndarray) -> np.ndarray:
    """Boundary vectors (..., F) of the same motion in a mirror: left becomes right."""
    source, sign = _exchange(spec)
    return vectors[..., source] * sign


@cache
def _exchange(spec: BoundarySpec) -> tuple[np.ndarray, np.ndarray]:
    """For each entry, the index (F,) int of the one it comes from, and its factor (F,)."""
    source, sign = np.arange(spec.size), np.ones(spec.size, np.float32)
    parts = spec.slices
    other = {"left": "right", "right": "left"}
    for row, name in enumerate(spec.pose_joints):
        side, _, rest = name.partition("_")
        twin = spec.pose_joints.index(f"{other[side]}_{rest}") if side in other else row
        own, its = (parts["pose"].start + 6 * i for i in (row, twin))
        source[own : own + 6] = np.arange(its, its + 6)
        # The first two columns of a rotation R; the mirror M turns it into M R M.
        sign[own : own + 6] = np.concatenate([-POLAR, POLAR])
    sign[parts["gravity"]] = POLAR
    linear = [POLAR] if spec.linear != "none" else []
    row = np.concatenate([*linear, *[AXIAL] * (1 + spec.chest)])
    sign[parts["history"]] = np.tile(row, len(spec.bins))
    return source, sign
