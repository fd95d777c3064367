# SPDX-License-Identifier: Apache-2.0
"""The statistical body `anny` as a plain character: joints, skin, six body shapes, a marked scalp.

Source: Bregier et al., "Human Mesh Modeling for Anny Body" (code Apache-2.0, data from MakeHuman, CC0).
"""

from dataclasses import dataclass

import numpy as np

from neuralocks_core.cache_folder import cache_folder, writable
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.mesh import connected_pieces
from neuralocks_core.skinned_body import Body

DEFAULT_PHENOTYPE = {"gender": 1.0, "age": 2 / 3, "muscle": 0.5, "weight": 0.45, "height": 0.5, "proportions": 0.6}
"""A young adult woman; anny's parameters lie in 0..1 (gender 1 is female, age 2/3 is 25 years)."""

SHAPES = {
    "male": ("gender", 0.0),
    "old": ("age", 1.0),
    "muscular": ("muscle", 1.0),
    "heavy": ("weight", 1.0),
    "tall": ("height", 0.8),
    "ideal": ("proportions", 1.0),
}
"""Blend shape -> the phenotype parameter that it moves and its value at weight 1.

Useful weights are 0..1 for `male`, -0.5..1 for the others.
"""

_TO_Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # anny is Z up and faces -Y

_HAIRLINE = np.array(
    # (forward, up) from the head joint in units of its distance to the crown.
    [
        *[(-0.4, -0.2), (-0.24, -0.17)],  # nape
        *[(-0.12, 0.05), (-0.09, 0.36), (0.1, 0.37)],  # behind the ear and over it
        *[(0.13, 0.26), (0.24, 0.28)],  # sideburn
        *[(0.32, 0.5), (0.43, 0.65), (0.55, 0.7)],  # temple, forehead
    ]
)


@dataclass(frozen=True)
class StatisticalBody:
    """A character with data that only its mesh has.

    Attributes:
        character: skeleton and body; the body's triangles are the halved `faces`.
        faces: quads (F, 4) int into the body's points, outward.
        scalp: indices of the faces that carry hair, (n,).
        colors: linear RGB per point (V, 3): skin, eyes and a dark suit.
    """

    character: Character
    faces: np.ndarray
    scalp: np.ndarray
    colors: np.ndarray


def statistical_body(phenotype: dict[str, float] | None = None) -> StatisticalBody:
    """Build the body; the first call takes about a minute, later ones use anny's cache.

    Args:
        phenotype: values in 0..1 that replace those of `DEFAULT_PHENOTYPE`.

    Raises:
        NeuralocksError: anny is not installed, or a phenotype is unknown or out of range.
    """
    wanted = {**DEFAULT_PHENOTYPE, **(phenotype or {})}
    for name, value in wanted.items():
        if name not in DEFAULT_PHENOTYPE:
            raise NeuralocksError(f"phenotype '{name}': unknown; use one of {', '.join(DEFAULT_PHENOTYPE)}")
        if not 0 <= value <= 1:
            raise NeuralocksError(f"phenotype '{name}': {value} is outside 0..1; give a value inside")
    model = _load_anny()
    rest = _Rest(model, wanted)
    keep, faces = _without_tongue(rest.points, model.faces.numpy())
    floor = np.array([0, rest.points[keep, 1].min(), 0])
    bind = rest.bones.copy()
    bind[:, :3, 3] -= floor
    weights = np.zeros((len(keep), len(bind)))
    bones, shares = model.vertex_bone_indices.numpy()[keep], model.vertex_bone_weights.numpy()[keep]
    np.add.at(weights, (np.arange(len(keep))[:, None], bones), shares)
    shapes = {}
    for shape, (name, value) in SHAPES.items():
        other = _Rest(model, {**wanted, name: value})
        shapes[shape] = _on_same_skeleton(other, rest, model.bone_parents, weights, keep) - rest.points[keep]

    labels, parents = list(model.bone_labels), list(model.bone_parents)
    weights, labels, parents, bind = _merge_fingers(weights, labels, parents, bind)
    indices, weights = _four_largest(weights)
    names = []
    for label, parent in zip(labels, parents, strict=True):
        names.append(label.lower() if parent < 0 else f"{names[parent]}/{label}")
    body = Body(
        points=rest.points[keep] - floor,
        triangles=np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]]),
        joint_indices=indices,
        joint_weights=weights,
        shapes=shapes,
    )
    character = Character(Skeleton(names, parents, bind), body)
    return StatisticalBody(character, faces, _scalp(character, faces), _colors(body, faces, labels))


def _load_anny():
    try:
        from anny import Anny
        from anny.paths import get_anny_cache_path, set_anny_cache_path
    except ImportError:
        remedy = 'run: pip install "neuralocks[body]"'
        raise NeuralocksError(f"anny: the statistical body is not installed; {remedy}") from None
    from neuralocks_core.warp_device import start_warp

    if not writable(get_anny_cache_path()):
        set_anny_cache_path(cache_folder("anny"))
    start_warp("cpu")  # or it would print its banner to standard output, where a command's answer belongs
    return Anny(rig="game_engine", topology="anny-quads", pose_parameterization="local-ref")


class _Rest:
    """Points (V, 3), bone transforms (J, 4, 4) and bone heads (J, 3) of one phenotype at rest, Y up."""

    def __init__(self, model, phenotype):
        rest = model(phenotype_kwargs=phenotype)
        self.points = rest["rest_vertices"][0].double().numpy() @ _TO_Y_UP.T
        self.bones = rest["rest_bone_poses"][0].double().numpy().copy()
        self.bones[:, :3] = _TO_Y_UP @ self.bones[:, :3]
        # Bones include anny's ground offset; rest vertices and bone heads do not.
        self.heads = rest["rest_bone_heads"][0].double().numpy() @ _TO_Y_UP.T
        self.bones[:, :3, 3] = self.heads


def _without_tongue(points, faces):
    """Vertex indices kept and quads renumbered: all but the loose inside of the mouth, which hair never meets."""
    part = connected_pieces(faces, len(points))
    sizes = np.bincount(part)
    # The skin is the largest part; eyes lie off the middle plane, the tongue on it.
    centre = np.bincount(part, weights=points[:, 0]) / sizes
    wanted = (sizes == sizes.max()) | (np.abs(centre) > 0.005)
    keep = np.flatnonzero(wanted[part])
    number = np.full(len(points), -1)
    number[keep] = np.arange(len(keep))
    return keep, number[faces[wanted[part[faces[:, 0]]]]]


def _on_same_skeleton(shape, default, parents, weights, keep):
    """Points (V, 3) of a shape carried onto the default's joints, so that it can be a plain blend shape.

    Blend shapes do not move joints. Each bone's piece of skin is shifted to the default joint and scaled along the bone
    to the default length: limbs keep their length, while girth, head and trunk change.
    """
    points = np.zeros((len(keep), 3))
    for joint in range(len(default.heads)):
        mine = weights[:, joint] > 0
        if not mine.any():
            continue
        local = shape.points[keep[mine]] - shape.heads[joint]
        for child in np.flatnonzero(np.array(parents) == joint):
            if _continues(default.heads, parents, child):
                old, new = (s.heads[child] - s.heads[joint] for s in (shape, default))
                local = local + np.outer(local @ old / (old @ old), new - old)
        points[mine] += weights[mine, joint, None] * (local + default.heads[joint])
    return points


def _continues(heads, parents, child):
    """Whether the bone to `child` continues its parent's direction and is not a branch to a shoulder, thigh or finger."""
    siblings = [c for c in range(len(parents)) if parents[c] == parents[child]]
    middle = [c for c in siblings if abs(heads[c, 0]) < 1e-3]
    return len(siblings) == 1 or (len(middle) == 1 and middle[0] == child)


def _merge_fingers(weights, labels, parents, bind):
    """Fingers follow the hand: 30 joints fewer in every clip, and hair does not reach them."""
    finger = np.array([label.startswith(("thumb", "index", "middle", "ring", "pinky")) for label in labels])
    for joint in range(len(labels) - 1, -1, -1):
        if finger[joint]:
            weights[:, parents[joint]] += weights[:, joint]
    kept = np.flatnonzero(~finger)
    number = {int(old): new for new, old in enumerate(kept)} | {-1: -1}
    return weights[:, kept], [labels[i] for i in kept], [number[parents[i]] for i in kept], bind[kept]


def _four_largest(weights):
    """Joint indices and weights (V, 4), largest first, each row of weights summing to one."""
    indices = np.argsort(-weights, axis=1, kind="stable")[:, :4]
    values = np.take_along_axis(weights, indices, axis=1)
    values[values < 1e-4] = 0
    return np.where(values > 0, indices, 0), values / values.sum(axis=1, keepdims=True)


def _scalp(character, faces):
    """Faces above the hairline, seen from the side."""
    points = character.body.points
    joint = character.skeleton.bind[character.head, :3, 3]
    unit = points[:, 1].max() - joint[1]
    centre = (points[faces].mean(axis=1) - joint) / unit
    line = np.interp(centre[:, 2], _HAIRLINE[:, 0], _HAIRLINE[:, 1])
    above = (centre[:, 1] > line) & (np.abs(centre[:, 0]) < 0.6)
    return np.flatnonzero(above & (np.linalg.norm(centre, axis=1) < 1.3))


def _colors(body, faces, labels):
    """Skin where a suit would end, a dark suit elsewhere, brown eyes; linear RGB (V, 3)."""
    bare = np.isin(labels, ["head", "neck_01", "hand_l", "hand_r"])
    share = body.weight_on(bare)
    share = np.clip((share - 0.4) / 0.2, 0, 1)[:, None]
    colors = share * [0.58, 0.38, 0.29] + (1 - share) * [0.09, 0.1, 0.12]
    part = connected_pieces(faces, len(body.points))
    for eye in np.flatnonzero(np.bincount(part) < len(part) / 2):
        mine = np.flatnonzero(part == eye)
        pole = body.points[mine[body.points[mine, 2].argmax()]]
        iris = np.linalg.norm(body.points[mine] - pole, axis=1) < 0.0065
        colors[mine] = np.where(iris[:, None], [0.05, 0.03, 0.02], [0.75, 0.74, 0.72])
    return colors
