# SPDX-License-Identifier: Apache-2.0
"""`neuralocks rig evaluate`: the report card of mesh hair that moves on its bones, whatever moved it."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from pathlib import Path

import numpy as np

from neuralocks_core import metrics
from neuralocks_core.body.enclosed import proven_distances
from neuralocks_core.body.tree_search import surface_tree
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.mesh import vertex_normals
from neuralocks_core.models.runtime import cores
from neuralocks_core.progress import Progress, silent
from neuralocks_core.rig.rigging import moving_joints
from neuralocks_core.skinned_body import LEAST_WEIGHT

from ..border.damage import names_damage
from ..border.told_once import few
from ..shot.wind import recorded_wind
from .notes import chain_notes, rigged_notes
from .stage import RiggedHair, check_patterns, core_meshes, read_rigged_hair

VERTICES = 4000
"""Most vertices of the hair that are measured, evenly over its meshes."""
FRAMES, DEEPEST_FRAMES = 48, 8
"""Frames in which distances to the body are measured: the former evenly over the animation, the latter where hair seems deepest."""
LOOKED_AT = 1000
"""Most frames, evenly over the animation, among which the deepest are sought."""
ROUNDING = 0.01
"""Less than this [mm] counts as no swing and no depth."""


@dataclass(frozen=True)
class RigCard:
    """What was measured.

    Attributes:
        path: the stage.
        skeleton: its Skeleton prim.
        measures: `joints`, `chains`, `vertices`, `frames`; `swing_mm`: how far vertices are from where they would be carried
            rigidly (root mean square), `swing_most`: the chain that swings most, `swing_most_mm`; `jitter_mm`: the farthest
            that a vertex goes from one frame to the next once a pose has been held for two seconds, NaN if none is, or in gusts;
            `body` and `body_rigid`: `metrics.penetration` of the animation and of hair carried rigidly, shares in `body_frames`
            frames, the worst depth in those, too, in which hair seems deepest, with `deepest_at` (time code) and `deepest` (chain).
            Without a body near the hair, these are missing.
        notes: what a user should know.
    """

    path: Path
    skeleton: str
    measures: dict
    notes: list[str]

    def lines(self) -> list[str]:
        """What was measured, in words."""
        m = self.measures
        lines = [
            f"measured: {m['vertices']} vertices in {m['frames']} frames",
            f"swing: {m['swing_mm']:.1f} mm from hair carried rigidly, most of '{m['swing_most']}', "
            f"{m['swing_most_mm']:.1f} mm"
            if m["swing_most_mm"] > ROUNDING
            else "swing: none, as if hair were carried rigidly",
        ]
        if np.isfinite(m["jitter_mm"]):
            lines.append(f"held pose: jitter {m['jitter_mm']:.3f} mm")
        for name, words in (("body", ""), ("body_rigid", ", carried rigidly")):
            if name in m:
                b = m[name]
                where = f" ('{b['deepest']}' at {b['deepest_at']:g})" if b["penetration_worst_mm"] > ROUNDING else ""
                lines.append(
                    f"inside the body{words}: {b['penetration_percent']:.2f} % of vertices, deeper than 3 mm "
                    f"{b['penetration_3mm_percent']:.2f} %, at most {b['penetration_worst_mm']:.1f} mm{where}, "
                    f"in {m['body_frames']} frames"
                )
        if "body" not in m:
            lines.append("inside the body: not measured, no body of this skeleton is near the hair")
        return lines


@names_damage
def evaluate_rig(
    baked,
    *,
    skeleton: str | None = None,
    head: str | None = None,
    chains: list[str] | None = None,
    joints: dict[str, str] | None = None,
    progress: Progress | None = None,
) -> RigCard:
    """Measure rigged mesh hair as a stage moves it.

    Args:
        baked: path of a bake, or of any animated character with hair chains.
        skeleton, head, chains, joints: as for `read_rigged_hair`; of several skeletons, one that a bake moves comes first, and a
            note names the others.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: there is no such hair, it has no mesh, or nothing animates it.
    """
    hair = read_rigged_hair(baked, skeleton=skeleton, head=head, chains=chains, joints=joints, baked_first=True)
    check_patterns(hair, chains)
    rig, stage_rig, say = hair.rig, hair.stage_rig, progress or silent
    if not len(rig.points):
        raise NeuralocksError(
            f"{stage_rig.path}: no mesh that is shown is skinned to its hair joints; there is nothing to measure"
        )
    if len(stage_rig.time_codes) < 2:
        raise NeuralocksError(f"{stage_rig.path}: is not animated; give a bake, or an animated character")
    moving = moving_joints(rig.character.skeleton, rig.chains)
    some = np.flatnonzero(_hair_vertices(hair, moving))
    picked = np.linspace(0, len(some) - 1, min(len(some), VERTICES)).round().astype(int)
    vertices, lock = some[picked], rig.chains.chain[rig.weights[picked, 1:].argmax(axis=1)]
    posed = _Posed(hair, vertices, moving)
    off, jitter, seen, deep = _moved(posed, moving, say)
    each = {i: float(np.sqrt(off[lock == i].mean())) for i in np.unique(lock)}
    most = max(each, key=each.__getitem__)
    wind = stage_rig.joints.animation and recorded_wind(stage_rig.joints.animation, stage_rig.border)
    if wind and wind.gusts:  # no hair comes to rest
        jitter = float("nan")
    measures = {
        "joints": len(rig.chains),
        "chains": len(rig.chains.roots),
        "vertices": len(vertices),
        "frames": len(stage_rig.time_codes),
        "swing_mm": 1e3 * float(np.sqrt(off.mean())),
        "swing_most": rig.chains.chain_name(int(most)),
        "swing_most_mm": 1e3 * each[most],
        "jitter_mm": jitter,
    }
    if rig.character.body is not None:
        measures |= _depths(posed, seen, deep, [rig.chains.chain_name(int(i)) for i in lock], say)
    notes = rigged_notes(stage_rig) + chain_notes(hair, chains) + _not_measured(hair)
    return RigCard(Path(baked), stage_rig.path, measures, notes)


class _Posed:
    """Some vertices of the hair, and the skin, as the animation poses them, in canonical space [m]."""

    def __init__(self, hair: RiggedHair, vertices: np.ndarray, moving: np.ndarray):
        self.codes, self.clip = hair.stage_rig.time_codes, hair.stage_rig.clip
        self._character, self.skin = hair.stage_rig.character, hair.rig.character.body
        self._moving = moving
        self._hair = self._character.body.part(vertices, np.zeros((0, 3), int))
        self.at_rest = self._character.canonical(self._hair.points)

    @cached_property
    def from_skin(self) -> np.ndarray:
        """Signed distances (V,) [m] of the vertices to the skin in bind pose."""
        return proven_distances(self._character.canonical(self.skin.points), self.skin.triangles, self.at_rest)

    def each(self, say) -> Iterator[np.ndarray]:
        """Vertices (2, V, 3) of one sample after the other, and where they would be carried rigidly."""
        for row, (joints, shape) in enumerate(zip(self.clip.joints, self.clip.shape)):
            both = joints, _stiff(self._character, joints, self._moving)
            yield np.stack([self._hair.posed(self._character.skinning(here), shape) for here in both])
            say(row + 1, len(self.clip.joints), "posing the hair")

    def distances(self, row: int, points: np.ndarray) -> np.ndarray:
        """Signed distances (N,) [m] of points (N, 3) to the skin at a sample."""
        return proven_distances(self._skin_at(row), self.skin.triangles, points)

    def seemingly(self, row: int, points: np.ndarray) -> float:
        """How deep in the skin the deepest of points (V, 3) seems to be [m]: beneath the plane of the vertex nearest to it, and
        deeper than at rest.
        """
        vertices = self._skin_at(row)
        nearest = self._used[surface_tree(vertices[self._used]).query(points)[1]]
        normals = vertex_normals(vertices, self.skin.triangles)[nearest]
        heights = np.einsum("vi,vi->v", points - vertices[nearest], normals)
        return float(np.max(np.minimum(self.from_skin, 0) - heights))

    @cached_property
    def _used(self) -> np.ndarray:
        """Vertices (n,) of the skin that some triangle has."""
        return np.unique(self.skin.triangles)

    def _skin_at(self, row: int) -> np.ndarray:
        return self.skin.posed(self._character.skinning(self.clip.joints[row]), self.clip.shape[row])


def _moved(
    posed: _Posed, moving: np.ndarray, say
) -> tuple[np.ndarray, float, dict[int, np.ndarray], dict[int, np.ndarray]]:
    """Mean squared distances (V,) [m^2] of vertices from where they would be carried rigidly; the largest step [mm] of any
    where all other joints have been still for `metrics.QUIET_AFTER`, NaN if they never are; and the vertices (2, V, 3) of the rows in
    which distances to the body are measured, evenly spread ones, and others in which hair seems deepest. Other vertices are not
    kept: a long animation has gigabytes of them.
    """
    clip, total, steps, seen, deep, before = posed.clip, 0.0, [], {}, [], None
    still = metrics.held(clip.joints[:, ~moving], clip.times)
    quiet = clip.times - np.maximum.accumulate(np.where(still, -np.inf, clip.times)) >= metrics.QUIET_AFTER
    wanted = set(np.linspace(0, len(clip.times) - 1, min(len(clip.times), FRAMES)).round().astype(int).tolist())
    every = -(-len(clip.times) // LOOKED_AT)
    for row, both in enumerate(posed.each(say)):
        total = total + np.square(both[0] - both[1]).sum(axis=-1)
        if row and quiet[row - 1] and quiet[row]:
            steps.append(metrics.jitter(np.stack([before, both[0]])))
        if row in wanted:
            seen[row] = both
        elif posed.skin is not None and row % every == 0:
            deep = sorted([*deep, (posed.seemingly(row, both[0]), row, both)], key=itemgetter(0))[-DEEPEST_FRAMES:]
        before = both[0]
    return total / len(clip.times), max(steps, default=float("nan")), seen, {row: both for _, row, both in deep}


def _depths(posed: _Posed, seen: dict[int, np.ndarray], deep: dict[int, np.ndarray], locks: list[str], say) -> dict:
    """How far vertices of `_moved` are inside the body, as the animation moves them and as they would be carried rigidly."""
    kept, rows, measured = seen | deep, [*seen, *deep], []
    with ThreadPoolExecutor(cores()) as pool:
        for done, distance in enumerate(pool.map(lambda row: posed.distances(row, kept[row].reshape(-1, 3)), rows)):
            measured.append(distance.reshape(2, -1))
            say(done + 1, len(rows), "measuring distances to the body")
    result: dict = {"body_frames": len(seen)}
    for name, distance in zip(("body", "body_rigid"), np.stack(measured, axis=1)):
        row, vertex = np.unravel_index(np.argmin(distance - np.minimum(posed.from_skin, 0)), distance.shape)
        deepest = {"deepest_at": float(posed.codes[rows[row]]), "deepest": locks[vertex]}
        shares = metrics.penetration(distance[: len(seen)], posed.from_skin)
        worst = metrics.penetration(distance, posed.from_skin)["penetration_worst_mm"]
        result[name] = shares | {"penetration_worst_mm": worst} | deepest
    return result


def _not_measured(hair: RiggedHair) -> list[str]:
    """The note on hair of other skeletons."""
    return few([f"{path}: its hair is not measured; name it with --skeleton" for path in hair.others], "have hair, too")


def _hair_vertices(hair: RiggedHair, moving: np.ndarray) -> np.ndarray:
    """Which vertices (V,) of all meshes the hair joints move, in the order of `HairRig.points`."""
    return np.concatenate([mesh.weight_on(moving) > LEAST_WEIGHT for mesh in core_meshes(hair.stage_rig)])


def _stiff(character: Character, joints: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """World joint transforms (J, 4, 4) in which hair joints relate to their parents as in the bind pose."""
    bind, parents, result = character.skeleton.bind, character.skeleton.parents, joints.copy()
    for joint in np.flatnonzero(moving):  # parents come first
        up = parents[joint]
        result[joint] = result[up] @ character.inverse_bind[up] @ bind[joint]
    return result
