# SPDX-License-Identifier: Apache-2.0
"""Hair stays on skin that blend shapes move: a face's, or that of a body with another shape than the one it was groomed on."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from neuralocks_core.body.collider import Collider, closest_on_triangle
from neuralocks_core.strands.strand_set import StrandSet

if TYPE_CHECKING:
    from neuralocks_core.character import Character
    from neuralocks_core.motion import Clip

NEAR, FAR = 0.02, 0.04
"""Roots up to NEAR from the skin [m] move with it, those from FAR on do not, and those in between in part."""
STAYS = 1e-6
"""Skin that a shape moves by less than this [m] counts as still."""
BETTER = 5e-4
"""Hair was groomed on a body with blend shapes if its roots are closer to that body's skin by this much [m] in the median."""
ASTRAY = 0.3
"""Roots farther from the skin than this [m], on a person, are not where an artist has put them: hats and wigs are nearer."""
SOME_ROOTS = 1000
"""About this many roots decide on which body."""


class RootSkin:
    """Carries each strand along as a whole, by as much as blend shapes move the skin at its root.

    Joints do not matter here: like the rest of the strand, its root rides on the joint that carries the groom.

    Args:
        character: whose blend shapes; without a body nothing is done.
        grooms: of its head, at rest, concatenated. Each was made either for the body without blend shapes or for the one at the
            start of the animation; its roots decide which fits better.
        clip: whose blend shapes will be asked for.

    Attributes:
        moves: whether a blend shape of the clip moves the skin at any root.
    """

    def __init__(self, character: Character, grooms: list[StrandSet], clip: Clip) -> None:
        shaped = character.body is not None and clip.shape.any()
        self._below = [_below(character, groom, clip) if shaped else None for groom in grooms]
        self._counts = [len(groom.rest) for groom in grooms]
        self.moves = any(below is not None for below in self._below)
        self._shift = self.moved(clip.shape[0]) if self.moves else None

    def moved(self, shape: np.ndarray) -> np.ndarray:
        """How far strands are carried (S, 1, 3) float32 [m], canonical, with blend shape weights (B,)."""
        each = [
            np.zeros((count, 3), np.float32) if below is None else below.moved(shape)
            for below, count in zip(self._below, self._counts, strict=True)
        ]
        return np.concatenate(each)[:, None]

    def begun(self, strands: StrandSet) -> StrandSet:
        """The same strands placed on the body as it is when the animation begins."""
        return strands.carried(self._shift) if self.moves else strands

    def carry(
        self, displacement: np.ndarray, shape: np.ndarray, then: Callable[[np.ndarray], None] | None = None
    ) -> None:
        """Carry hair along, in place.

        Args:
            displacement: (S, 24, 3) float32 [m], canonical.
            shape: blend shape weights (B,).
            then: changes it further, in place, as a displacement from the strands of `begun`.
        """
        if self.moves:
            displacement += self.moved(shape) - self._shift
        if then is not None:
            then(displacement)
        if self.moves:
            displacement += self._shift


class _Below:
    """The skin below the roots of one groom.

    Args:
        character: with a body.
        roots: (S, 3) [m], canonical.
        faces: (F, 3) the triangles near them.
        made_for: blend shape weights (B,) of the body that the groom was made for.
    """

    def __init__(self, character: Character, roots: np.ndarray, faces: np.ndarray, made_for: np.ndarray) -> None:
        body, self._made_for = character.body, made_for
        mesh = Collider(character.canonical(body.shaped(made_for)), faces)
        distance, _, triangle = mesh.closest(roots, limit=FAR)
        corners = mesh.triangles[triangle]
        share = np.clip((FAR - np.abs(distance)) / (FAR - NEAR), 0, 1)
        self._weights = (share[:, None] * _barycentric(roots, mesh.points[corners])).astype(np.float32)
        used, corners = np.unique(corners, return_inverse=True)
        self._corners = corners.reshape(-1, 3)
        ways = [offsets[used] @ character.facing.T for offsets in body.shapes.values()]
        self._ways = [way if np.abs(way).max() > STAYS else None for way in ways]
        self._count = len(used)

    def moved(self, shape: np.ndarray) -> np.ndarray:
        """How far each strand is carried (S, 3) float32 [m]; exactly zero for the body that it was made for."""
        skin = np.zeros((self._count, 3))
        for way, weight in zip(self._ways, shape - self._made_for, strict=True):
            if weight and way is not None:
                skin += weight * way
        return np.einsum("sc,scx->sx", self._weights, skin.astype(np.float32)[self._corners])


def _below(character: Character, groom: StrandSet, clip: Clip) -> _Below | None:
    """The skin below a groom, or None if no blend shape of the clip moves it."""
    body, begun, roots = character.body, clip.shape[0], groom.rest[:, 0].astype(float)
    if not groom.valid.any():
        return None
    shapes = [offsets for offsets, weights in zip(body.shapes.values(), clip.shape.T, strict=True) if weights.any()]
    low, high = roots[groom.valid].min(axis=0) - FAR, roots[groom.valid].max(axis=0) + FAR
    places = [character.canonical(points) for points in (body.points, body.shaped(begun))]
    near = np.any([((at >= low) & (at <= high)).all(axis=1) for at in places], axis=0)
    faces = body.triangles[near[body.triangles].any(axis=1)]
    used = np.unique(faces)
    if not any(np.abs(offsets[used]).max(initial=0.0) > STAYS for offsets in shapes):
        return None
    made_for = np.zeros(len(begun))
    if begun.any():
        some = roots[groom.valid][:: max(1, int(groom.valid.sum()) // SOME_ROOTS)]
        plain, shaped = (np.median(np.abs(Collider(at, faces).distance(some, limit=FAR)[0])) for at in places)
        made_for = begun if shaped < plain - BETTER else made_for
    return None if (clip.shape == made_for).all() else _Below(character, roots, faces, made_for)


def _barycentric(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Weights (n, 3) of the corners (n, 3, 3) of triangles of the place nearest to each point (n, 3)."""
    a, b, c = corners.transpose(1, 0, 2)
    place, _ = closest_on_triangle(points, a, b, c)
    # Areas of the parts into which this place divides its triangle.
    parts = [np.cross(c - b, place - b), np.cross(a - c, place - c), np.cross(b - a, place - a)]
    whole = np.cross(b - a, c - a)
    shares = np.stack([(part * whole).sum(axis=1) for part in parts], axis=1)
    return shares / np.square(whole).sum(axis=1)[:, None]
