# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender rig, read as arrays, as the core's character; and messages about what is wrong with it."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cached_property

import numpy as np

from neuralocks_core.anatomy.humanoid import Humanoid, find_humanoid
from neuralocks_core.anatomy.standing import standing
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import Groom
from neuralocks_core.mesh import inside_out
from neuralocks_core.rotation import sizes_shown, transformed
from neuralocks_core.skinned_body import Body

from . import names
from .axes import to_core
from .motion import similar, trim_of


@dataclass(frozen=True, eq=False)
class RigArrays:
    """An armature's rest pose, in the armature's own space and Blender's unit.

    Attributes:
        name: the armature object's name.
        bones: bone names, parents first, (J).
        parents: (J,) int.
        rest: rest transforms in armature space, (J, 4, 4).
        head_bone: name of the head bone if the artist chose one.
        skinned: which bones (J,) move skin, if that is known.
    """

    name: str
    bones: tuple[str, ...]
    parents: np.ndarray
    rest: np.ndarray
    head_bone: str = ""
    skinned: np.ndarray | None = None

    @cached_property
    def paths(self) -> list[str]:
        """Joint paths (J)."""
        return names.joint_paths(list(self.bones), list(self.parents))

    @cached_property
    def _renamed(self) -> dict[str, str]:
        """Bones by the last parts of their joint paths, those alone that a path cannot call by their names."""
        pairs = zip((path.rpartition("/")[2] for path in self.paths), self.bones, strict=True)
        return {joint: bone for joint, bone in pairs if joint != bone}

    def said(self, text: str) -> str:
        """A line about joints with the names of their bones, such as `hair.01` for `hair_01`."""
        return re.sub(r"\w+", lambda word: self._renamed.get(word[0], word[0]), text)

    def patterns(self, text: str) -> list[str]:
        """Patterns of joints from an artist's patterns of bones, separated by commas; a joint's name counts, too. A bone's own name is no
        pattern, such as `hair[L]`.
        """
        found = []
        for word in filter(None, map(str.strip, text.split(","))):
            matches = str.__eq__ if word in self.bones else fnmatchcase
            found += [path for path, bone in zip(self.paths, self.bones, strict=True) if matches(bone, word)] or [word]
        return found

    def named_head(self) -> int | None:
        """The bone that is named like a head, whatever the artist chose; None if there is none."""
        try:
            return self._found({})["head"]
        except NeuralocksError:
            return None

    @cached_property
    def humanoid(self) -> Humanoid:
        """Which bone is which; errors are in the words of the panel.

        Raises:
            NeuralocksError: there are no bones, or none for the head.
        """
        if not self.bones:
            raise NeuralocksError(f"{self.name}: the armature has no bones; choose the armature that moves the body")
        if self.head_bone:
            if self.head_bone not in self.bones:
                raise NeuralocksError(f"{self.name}: it has no bone '{self.head_bone}'; choose the head bone again")
            return self._found({"head": self.paths[self.bones.index(self.head_bone)]})
        try:
            return self._found({})
        except NeuralocksError:
            raise NeuralocksError(f"{self.name}: no bone is named like a head; choose the head bone") from None

    def _found(self, by_hand: dict[str, str]) -> Humanoid:
        return find_humanoid(self.paths, self.parents, self.rest[:, :3, 3], by_hand, self.skinned)


@dataclass(frozen=True, eq=False)
class BodyArrays:
    """A skinned mesh at rest, in its own space.

    Attributes:
        name: the mesh object's name.
        points: (V, 3); triangles: (F, 3).
        groups: vertex group names; weights: (N, 3) rows of vertex, group, weight.
        shapes: shape key name -> offsets (V, 3).
    """

    name: str
    points: np.ndarray
    triangles: np.ndarray
    groups: tuple[str, ...]
    weights: np.ndarray
    shapes: dict[str, np.ndarray] = field(default_factory=dict)


INFLUENCES = 4
"""Joints that move one vertex, at most: the strongest are kept."""


def joint_weights(body: BodyArrays, bones: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Joint indices and weights (V, 4) of the body; vertices without weights stay with the first joint."""
    column = {bone: i for i, bone in enumerate(bones)}
    joint_of_group = np.array([column.get(group, -1) for group in body.groups] or [-1])
    count = len(body.points)
    indices, weights = np.zeros((count, INFLUENCES), int), np.zeros((count, INFLUENCES))
    if len(body.weights):
        vertex, group = body.weights[:, 0].astype(int), body.weights[:, 1].astype(int)
        joint, weight = joint_of_group[group], body.weights[:, 2]
        kept = (joint >= 0) & (weight > 0)
        vertex, joint, weight = vertex[kept], joint[kept], weight[kept]
        # The strongest first; of equal ones, the first joint. Rows come nearly in the order of the vertices, which a sort by one
        # number exploits: `np.lexsort` by all three takes six times as long.
        order = np.argsort(vertex * len(bones) + joint, kind="stable")
        vertex, joint, weight = vertex[order], joint[order], weight[order]
        order = np.argsort(2 * weight.max(initial=0) * vertex - weight, kind="stable")
        vertex, joint, weight = vertex[order], joint[order], weight[order]
        rank = np.arange(len(vertex)) - np.searchsorted(vertex, vertex)
        strong = rank < INFLUENCES
        indices[vertex[strong], rank[strong]] = joint[strong]
        weights[vertex[strong], rank[strong]] = weight[strong]
    total = weights.sum(axis=1, keepdims=True)
    weights[total[:, 0] <= 0, 0] = 1
    return indices, weights / np.where(total > 0, total, 1)


def character(
    rig: RigArrays,
    place: np.ndarray,
    bodies: Sequence[tuple[BodyArrays, np.ndarray]] = (),
    metres: float = 1.0,
) -> Character:
    """The character in the core's space.

    Args:
        rig: the armature at rest.
        place: world transform (4, 4) of the armature object in the bind pose, as `stood_up` gives it.
        bodies: skinned meshes, each with its world transform in the bind pose; together they are the body.
        metres: of one unit of this bind pose; see `SampledRig.bind_metres`.
    """
    core = to_core(metres)
    humanoid = rig.humanoid
    skeleton = Skeleton(tuple(rig.paths), rig.parents, core @ bind_world(rig, place))
    labels = iter(shape_names([body for body, _ in bodies]))
    parts = [_body(body, body_place, core, rig.bones, labels) for body, body_place in bodies]
    return Character(skeleton, Body.joined(parts), humanoid)


def same(a: Character, b: Character) -> bool:
    """Whether two characters are equal in all that hair reads of them."""
    if (a.skeleton.names, a.humanoid.joints, a.body is None) != (b.skeleton.names, b.humanoid.joints, b.body is None):
        return False
    pairs = [(a.skeleton.parents, b.skeleton.parents), (a.skeleton.bind, b.skeleton.bind)]
    if a.body is not None:
        if list(a.body.shapes) != list(b.body.shapes):
            return False
        parts = ("points", "triangles", "joint_indices", "joint_weights")
        pairs += [(getattr(a.body, part), getattr(b.body, part)) for part in parts]
        pairs += zip(a.body.shapes.values(), b.body.shapes.values())
    return all(np.array_equal(one, other) for one, other in pairs)


def same_arrays(a: BodyArrays, b: BodyArrays) -> bool:
    """Whether two bodies are the same, to the last bit."""
    if (a.name, a.groups, list(a.shapes)) != (b.name, b.groups, list(b.shapes)):
        return False
    pairs = [(getattr(a, part), getattr(b, part)) for part in ("points", "triangles", "weights")]
    return all(np.array_equal(one, other) for one, other in [*pairs, *zip(a.shapes.values(), b.shapes.values())])


def size_shown(rig: RigArrays, place: np.ndarray, heads: np.ndarray) -> float:
    """How much larger a motion shows the head than the bind pose does, as `usd` measures it in a stage; `heads` are its world
    transforms (T, 4, 4) from channels, `place` is as for `character`.
    """
    head = rig.humanoid["head"]
    size = float(np.median(sizes_shown(heads, bind_world(rig, place)[head])))
    return 1.0 if abs(size - 1) < 1e-4 else size


def stood_up(rig: RigArrays, place: np.ndarray) -> np.ndarray:
    """Where an armature object at `place` (4, 4) stands in the bind pose: at the same place, upright."""
    similar(place, rig.name)  # for an error with the rig's name
    result = np.array(place, float)
    result[:3, :3] = standing(result[:3, :3], rig.rest[:, :3, 3], rig.humanoid, np.array([0.0, 0.0, 1.0]))
    return result


def bind_world(rig: RigArrays, place: np.ndarray) -> np.ndarray:
    """Bind transforms (J, 4, 4) in Blender's world, without scale, for an armature object that stands at `place`."""
    bind = similar(place @ rig.rest, rig.name)
    return bind @ trim_of(bind, rig.name)


def skin(body: BodyArrays, place: np.ndarray) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Points (V, 3) float32, triangles (F, 3) and shape key offsets (V, 3) float32 of a body that stands at `place`, in
    Blender's world: what an exported stage stores.

    Pushing hair out of a body is not continuous: a difference in the seventh digit may move a strand by centimetres.
    """
    points = transformed(body.points, place).astype(np.float32)
    shapes = {name: (offsets @ place[:3, :3].T).astype(np.float32) for name, offsets in body.shapes.items()}
    triangles = body.triangles[:, ::-1] if np.linalg.det(place[:3, :3]) < 0 else body.triangles
    return points, triangles[:, ::-1] if inside_out(points, triangles) else triangles, shapes


def _body(body: BodyArrays, place: np.ndarray, core: np.ndarray, bones: tuple[str, ...], labels: Iterator[str]) -> Body:
    """A part of the body, whose shapes take the next of `labels`: two parts may have the same shape names."""
    points, triangles, shapes = skin(body, place)
    shapes = {next(labels): offsets @ core[:3, :3].T for offsets in shapes.values()}
    return Body(transformed(points, core), triangles, *joint_weights(body, bones), shapes)


def shape_names(bodies: Sequence[BodyArrays]) -> list[str]:
    """Identifiers of all shape keys, body after body, in their order."""
    return names.unique([name for body in bodies for name in body.shapes])


def check_strands(name: str, points: np.ndarray, counts: np.ndarray) -> None:
    """Refuse hair that cannot move; the arguments are those of `groom`.

    Raises:
        NeuralocksError: it is empty, has only single points, or is not finite.
    """
    if not len(counts) or not len(points):
        raise NeuralocksError(f"{name}: the hair has no strands; add hair to it or choose another object")
    if counts.max() < 2:
        raise NeuralocksError(f"{name}: every strand has one point only; give the strands two points or more")
    if not np.isfinite(points).all():
        raise NeuralocksError(f"{name}: some points are not finite; delete these strands")


def groom(
    name: str,
    points: np.ndarray,
    counts: np.ndarray,
    place: np.ndarray,
    metres: float = 1.0,
    radius: np.ndarray | None = None,
) -> Groom:
    """The groom in bind world space.

    Args:
        name: its name in messages.
        points: (P, 3) in the hair object's space; counts: (S,).
        place: world transform (4, 4) of the hair object in the bind pose.
        metres: of one unit of the bind pose; see `SampledRig.bind_metres`.
        radius: of each point (P,) or strand (S,), in the hair object's space.
    """
    check_strands(name, points, counts)
    matrix = to_core(metres) @ place
    size = np.cbrt(abs(np.linalg.det(matrix[:3, :3])))
    widths = None if radius is None or not len(radius) else 2 * np.maximum(radius, 0) * size
    return Groom(name, transformed(points, matrix), counts, widths)


def advice(rig: RigArrays) -> list[str]:
    """What an artist should know about the rig, in plain words; an empty list is good news."""
    found = rig.humanoid
    lines = []
    unseen = {
        "neck": "the neck bend",
        "upper_chest": "the body turn",
        "left_upper_arm": "the left arm",
        "right_upper_arm": "the right arm",
    }
    for part, what in unseen.items():
        if part not in found:
            lines.append(f"No {part.replace('_', ' ')} bone found: the hair will not see {what}")
    return lines
