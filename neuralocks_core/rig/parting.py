# SPDX-License-Identifier: Apache-2.0
"""Which parts of a rig's meshes are hair and which are body, however they are divided into meshes."""

from dataclasses import dataclass

import numpy as np

from neuralocks_core.character import Character
from neuralocks_core.mesh import rays_through, welded_pieces
from neuralocks_core.rig.hair_names import says_face
from neuralocks_core.rig.skinned_mesh import LEAST_WEIGHT, SkinnedMesh

ASIDE, DOWN = (-30, 0, 30), (5, 20, 35, 50)
"""Directions from the middle of the head to the face, to the side and below the horizon [degrees]: fringes seldom reach there."""
FACE = 0.5
"""Share of these directions in which a piece lies that is the skin of a face."""
CAP = 0.5
"""Size of the smallest cap of hair, relative to the head."""
MOSTLY = 0.2
"""If joints of the hair move more than this share of a mesh that only the head drives, and that has no face, all of it is hair, with
ribbons and pins."""


def parted(character: Character, meshes: list[SkinnedMesh], moving: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Which triangles are body and which vertices are hair that moves.

    The roots of locks, and the cap that they grow from, ride on the head as its skin does, and each may be in any mesh. So what does
    not move of each connected piece is judged by itself: skin goes on below the head, is moved by joints of the face, or has the
    face. Otherwise it is hair if the rest of its piece is, or if it is large enough to be a cap; eyes, ears and horns are not. A mesh
    of hair alone is hair as a whole.

    Args:
        character: skeleton and head.
        meshes: its skinned meshes.
        moving: joints (J,) of the hair.

    Returns:
        for each mesh, triangles (F', 3) of the body and a mask (V,) of hair.
    """
    moved = [mesh.weight_on(moving) > LEAST_WEIGHT for mesh in meshes]
    parts = [_parts(character, mesh, moves) if moves.any() else [] for mesh, moves in zip(meshes, moved)]
    sizes = [_size(_on_head(character, mesh)) for mesh, moves in zip(meshes, moved) if not moves.any()]
    head = max([*sizes, *(part.size_on_head for own in parts for part in own if part.skin)], default=0.0)
    result = []
    for mesh, moves, own in zip(meshes, moved, parts):
        body = ~moves
        for part in own:
            body[part.vertices] = part.skin or not (part.hair or part.size > CAP * head)
        result.append((mesh.triangles[body[mesh.triangles].all(axis=1)], moves))
    return result


@dataclass(frozen=True)
class _Part:
    """What does not move of one connected piece of a mesh.

    Attributes:
        vertices: (N,) int.
        size, size_on_head: diagonals of the box around it, and around what rides on the head alone [m].
        skin, hair: whether it certainly is one of these.
    """

    vertices: np.ndarray
    size: float
    size_on_head: float
    skin: bool
    hair: bool


def _parts(character: Character, mesh: SkinnedMesh, moves: np.ndarray) -> list[_Part]:
    of_face = np.array([says_face(name) for name in character.skeleton.names])
    face, outside = (mesh.weight_on(joints) > LEAST_WEIGHT for joints in (of_face, ~character.of_head))
    piece = welded_pieces(mesh.points, mesh.triangles)
    count = piece.max() + 1
    on_head = mesh.triangles[~(outside | moves)[mesh.triangles].any(axis=1)]
    with_face = _with_face(character, mesh.points, on_head, piece)
    among_hair = moves.mean() > MOSTLY and not outside.any() and not with_face.any()
    skin = ((np.bincount(piece, (face | outside) & ~moves, count) > 0) | with_face) & ~np.bool_(among_hair)
    hair = (np.bincount(piece, moves, count) > 0) | among_hair
    still = np.flatnonzero(~moves)
    still = still[np.argsort(piece[still], kind="stable")]
    found = []
    for vertices in np.split(still, np.flatnonzero(np.diff(piece[still])) + 1) if len(still) else ():
        number, riding = piece[vertices[0]], vertices[~outside[vertices]]
        sizes = _size(mesh.points[vertices]), _size(mesh.points[riding])
        found.append(_Part(vertices, *sizes, bool(skin[number]), bool(hair[number])))
    return found


def _with_face(character: Character, points: np.ndarray, triangles: np.ndarray, piece: np.ndarray) -> np.ndarray:
    """Which pieces, of which each point has the number, lie with their triangles in the directions of the face."""
    aside, down = np.radians(np.meshgrid(ASIDE, DOWN)).reshape(2, -1)
    ways = np.stack([np.sin(aside) * np.cos(down), -np.sin(down), np.cos(aside) * np.cos(down)], axis=1)
    ray, triangle = rays_through(character.canonical(points), triangles, character.head_centre, ways)
    hit = np.zeros((len(ways), piece.max() + 1), bool)
    hit[ray, piece[triangles[triangle, 0]]] = True
    return hit.mean(axis=0) > FACE


def _on_head(character: Character, mesh: SkinnedMesh) -> np.ndarray:
    """Points of a mesh that ride on the head alone."""
    return mesh.points[mesh.weight_on(~character.of_head) <= LEAST_WEIGHT]


def _size(points: np.ndarray) -> float:
    return float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
