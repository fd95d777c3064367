# SPDX-License-Identifier: Apache-2.0
"""Which parts of a rig's meshes are hair and which are body, however they are divided into meshes."""

from dataclasses import dataclass

import numpy as np

from neuralocks_core.body.collider import Collider
from neuralocks_core.character import Character
from neuralocks_core.mesh import rays_through, welded_pieces
from neuralocks_core.rig.hair_names import says_face
from neuralocks_core.skinned_body import LEAST_WEIGHT, Body

MOSTLY = 0.2
"""If joints of the hair move more than this share of a mesh without skin, all of it is hair, with ribbons and pins."""
MAINLY = 0.5
"""Skin weight above which joints decide what a vertex belongs to: automatic weights bleed."""
FACE = 0.3
"""Share of the directions of the face in which a piece is the innermost that is the skin there: eyes and teeth are in fewer."""
CROWN = 0.5
"""Share of the directions of the crown that a cap of hair covers: horns, ears and glasses are in fewer."""
HAT = 0.5
"""Diagonal of the box around the largest cap, on a human [m]."""
ABOVE, BEHIND = 30, 110
"""Elevation above brows, and azimuth behind ears [degrees]: what reaches there on a head, or is there, is hair."""
NEAR = 0.03
"""The outermost points of fringes and cards are this near to skin, on a human [m]: horns reach away."""


def _ways(*directions: tuple[tuple, tuple]) -> np.ndarray:
    """Unit vectors (n, 3) at all pairs of azimuths, from +Z to +X, and elevations [degrees]."""
    found = [np.radians(np.meshgrid(*each)).reshape(2, -1) for each in directions]
    aside, up = np.concatenate(found, axis=1)
    return np.stack([np.sin(aside) * np.cos(up), np.sin(up), np.cos(aside) * np.cos(up)], axis=1)


TO_FACE = _ways(((-30, 0, 30), (-5, -20, -35, -50)))
"""Directions from the middle of the head in which fringes seldom are."""
TO_CROWN = _ways(((-135, -90, 90, 135, 180), (25, 55)), ((0,), (85,)))
"""Directions from there in which there is no face."""


def parted(character: Character, meshes: list[Body], moving: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Which triangles are body and which vertices are hair that moves.

    The roots of locks, and the cap that they grow from, ride on the head as its skin does, and each may be in any mesh. So each
    connected piece of a mesh with locks is judged by itself: what goes on below the head is skin, and what is moved by joints of the
    face, or is the innermost where the face is; else a piece that moves is hair, roots included, and so are caps, and fringes and
    cards on the skull; eyes, ears and horns are not. A mesh of hair alone is hair as a whole.

    Args:
        character: skeleton and head.
        meshes: its skinned meshes.
        moving: joints (J,) of the hair.

    Returns:
        for each mesh, triangles (F', 3) of the body and a mask (V,) of hair.
    """
    every = [_Pieces.of(character, mesh, moving) for mesh in meshes]
    skins = [own.goes_on | face for own, face in zip(every, _with_face(character, meshes, every))]
    surface, result = _surface(meshes, every, skins), []
    for mesh, own, skin in zip(meshes, every, skins):
        if not own.hairy.any():
            body = ~own.moves
        elif own.moves.mean() > MOSTLY and not skin.any():
            body = np.zeros(len(mesh.points), bool)
        else:
            still = _caps(character, mesh, own) | _on_skull(character, mesh, own, surface)
            body = (skin | own.of_face | ~(own.hairy | still))[own.number] & ~own.moves
        result.append((mesh.triangles[body[mesh.triangles].all(axis=1)], own.moves))
    return result


@dataclass(frozen=True)
class _Pieces:
    """The connected pieces of a mesh.

    Attributes:
        number: of the piece that each vertex is in, (V,).
        moves: vertices (V,) that joints of the hair move.
        riding: triangles (F', 3) that ride on the head and do not move.
        goes_on, of_face, hairy: pieces (n,) that joints outside the head drive, of the face, or of the hair.
    """

    number: np.ndarray
    moves: np.ndarray
    riding: np.ndarray
    goes_on: np.ndarray
    of_face: np.ndarray
    hairy: np.ndarray

    @classmethod
    def of(cls, character: Character, mesh: Body, moving: np.ndarray) -> "_Pieces":
        faces = np.array([says_face(name) for name in character.own_names])
        number = welded_pieces(mesh.points, mesh.triangles) if len(mesh.points) else np.zeros(0, int)
        moves, outside = mesh.weight_on(moving) > LEAST_WEIGHT, mesh.weight_on(~character.of_head) > MAINLY
        driven = (outside, mesh.weight_on(faces) > MAINLY, mesh.weight_on(moving) > MAINLY)
        count = number.max(initial=-1) + 1
        riding = mesh.triangles[~(moves | outside)[mesh.triangles].any(axis=1)]
        return cls(number, moves, riding, *(np.bincount(number, vertices, count) > 0 for vertices in driven))


def _with_face(character: Character, meshes: list[Body], every: list[_Pieces]) -> list[np.ndarray]:
    """For each mesh, the pieces (n,) that are the innermost in directions of the face."""
    nearest, winner = np.full(len(TO_FACE), np.inf), np.full((len(TO_FACE), 2), -1)
    for place, (mesh, own) in enumerate(zip(meshes, every)):
        for ray, piece, far in zip(*_hits(character, mesh, own, TO_FACE)):
            if far < nearest[ray]:
                nearest[ray], winner[ray] = far, (place, piece)
    found = [np.zeros(len(own.hairy), bool) for own in every]
    for place, piece in {tuple(each) for each in winner.tolist() if each[0] >= 0}:
        found[place][piece] = (winner == (place, piece)).all(axis=1).mean() > FACE
    return found


def _caps(character: Character, mesh: Body, own: _Pieces) -> np.ndarray:
    """Pieces (n,) that cover the crown and are not as large as a hat."""
    ray, piece, _ = _hits(character, mesh, own, TO_CROWN)
    hit = np.zeros((len(TO_CROWN), len(own.hairy)), bool)
    hit[ray, piece] = True
    low, high = np.full((2, len(own.hairy), 3), np.inf)
    np.minimum.at(low, own.number, mesh.points)
    np.minimum.at(high, own.number, -mesh.points)
    size = np.linalg.norm(-high - low, axis=1)
    return (hit.mean(axis=0) > CROWN) & (size <= HAT * character.times_human)


def _surface(meshes: list[Body], every: list[_Pieces], skins: list[np.ndarray]) -> Collider | None:
    """The skin that rides on the head, in bind world; None if there is none."""
    found = [
        mesh.points[own.riding[skin[own.number[own.riding[:, 0]]]]] for mesh, own, skin in zip(meshes, every, skins)
    ]
    corners = np.concatenate([np.zeros((0, 3, 3)), *found])
    return Collider(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)) if len(corners) else None


def _on_skull(character: Character, mesh: Body, own: _Pieces, surface: Collider | None) -> np.ndarray:
    """Pieces (n,) that lie on the head's skin from where only hair grows."""
    count, near = len(own.hairy), NEAR * character.times_human
    offset = character.canonical(mesh.points) - character.head_centre
    x, y, z = offset.T
    above, behind = np.degrees(np.arctan2(y, np.hypot(x, z))) > ABOVE, np.abs(np.degrees(np.arctan2(x, z))) > BEHIND
    high, beside = (np.bincount(own.number, each, count) > 0 for each in (above, ~behind))
    found = (high | ~beside) & ~own.hairy & ~own.goes_on
    if surface is None or not found.any():
        return np.zeros(count, bool)
    order = np.lexsort((np.linalg.norm(offset, axis=1), own.number))
    tips = order[np.flatnonzero(np.diff(own.number[order], append=-1))]  # of each piece
    found[found] = np.abs(surface.distance(mesh.points[tips[found]], limit=near)[0]) < near
    return found


def _hits(character: Character, mesh: Body, own: _Pieces, ways: np.ndarray) -> tuple[np.ndarray, ...]:
    """Ray, piece and distance [m] wherever rays from the middle of the head meet what rides on it, (H,) each."""
    ray, triangle, far = rays_through(character.canonical(mesh.points), own.riding, character.head_centre, ways)
    return ray, own.number[own.riding[triangle, 0]], far
