# SPDX-License-Identifier: Apache-2.0
"""The body around the head of a rig with mesh hair: its poses, and distances of points from it."""

from dataclasses import replace

import numpy as np

from neuralocks_core.body.enclosed import proven_distances
from neuralocks_core.mesh import vertex_normals
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.skinned_body import Body
from neuralocks_core.training.rig.surface_samples import SurfaceSamples, nearest

KEPT = 2000
"""Number of places of each posed body that say which of its faces is nearest."""
AROUND = 1000
"""Number of body vertices that a simulation collides with."""
BEYOND = 0.1
"""They are no farther from the head than this beyond the ends of bones at rest [m]. `HairRig.in_reach` is wider, because it leaves out
nothing that hair may touch: of so few vertices, more would be far from the hair."""


class BodyPatch:
    """The part of the body around the head that hair can reach.

    Attributes:
        body: that part, with blend shapes that leave the head unchanged.
        samples: `count` places on it.
    """

    @classmethod
    def of(cls, rig: HairRig, count: int) -> "BodyPatch | None":
        """None if there is no body, or hair reaches none of its faces."""
        near = _in_reach(rig)
        return None if near is None else cls(near, rig.character.head, count)

    def __init__(self, near: Body, head: int, count: int):
        # The hair was fitted to its own head: other bodies vary below it.
        on_head = np.sum(near.joint_weights * (near.joint_indices == head), axis=1)
        shapes = {}
        for name, offsets in near.shapes.items():
            mean = offsets[on_head > 0.9].mean(axis=0) if (on_head > 0.9).any() else 0.0
            shapes[name] = (offsets - mean) * (1 - on_head)[:, None]
        self.body = replace(near, shapes=shapes)
        self.samples = SurfaceSamples(near.points, near.triangles, count)


def posed_distances(rig: HairRig, joints: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Signed distances (T, V) [m] of points (T, V, 3), canonical, to the body under world joint transforms (T, J, 4, 4)."""
    body = _in_reach(rig)
    if body is None:
        return np.full(points.shape[:2], np.inf)
    skinning = rig.character.skinning(joints)
    return np.stack([proven_distances(body.posed(m), body.triangles, p) for m, p in zip(skinning, points)])


def _in_reach(rig: HairRig) -> Body | None:
    """The part of the body that hair can reach; None if there is no such part."""
    body = rig.character.body
    near = None if body is None or not len(rig.points) else body.only(body.triangles[rig.in_reach(body)])
    return None if near is None or not len(near.triangles) else near


def rest_clearance(rig: HairRig, points: np.ndarray) -> np.ndarray:
    """Distance (V,) [m] that canonical points (V, 3) may come near the body: their distance in bind pose, exact or as
    `SurfaceSamples` have it, whichever is less.

    In poses, distances are those. Where they are wrong, hair would be thrown from where the artist put it.
    """
    exact, patch = rest_distances(rig, points), BodyPatch.of(rig, KEPT)
    if patch is None:
        return exact
    vertices, samples = rig.character.canonical(patch.body.points), patch.samples
    found = nearest(samples.index(vertices), points)
    read = (values[None, samples.corners] for values in (vertices, samples.normals(vertices)))
    normals, offsets = samples.planes(found, points, *read)
    return np.minimum(exact, np.einsum("vi,vi->v", points, normals) - offsets)


def rest_distances(rig: HairRig, points: np.ndarray) -> np.ndarray:
    """Signed distances (V,) [m] of canonical points (V, 3) to the body in bind pose; infinite without one."""
    body = rig.character.body
    if body is None:
        return np.full(len(points), np.inf)
    return proven_distances(rig.character.canonical(body.points), body.triangles, points)


def body_around(rig: HairRig, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """At most AROUND body vertices around the head for world joint transforms (T, J, 4, 4): points and normals (T, P, 3) in
    canonical space of the head; None if there are none.
    """
    body = rig.character.body
    if body is None:
        return None
    canonical = rig.character.canonical(body.points)
    reach = np.linalg.norm(rig.chains.origins, axis=1).max() + rig.chains.lengths.max() + BEYOND
    used = np.isin(np.arange(len(canonical)), body.triangles) & (np.linalg.norm(canonical, axis=1) < reach)
    near = np.flatnonzero(used)
    if not len(near):
        return None
    chosen = np.sort(np.random.default_rng(0).permutation(near)[:AROUND])
    normals = vertex_normals(body.points, body.triangles)[chosen]
    points, turned = np.empty((2, len(joints), len(chosen), 3), np.float32)
    for row, matrices in enumerate(rig.character.skinning(joints)):
        blended = np.einsum("vi,vixy->vxy", body.joint_weights[chosen], matrices[body.joint_indices[chosen], :3])
        points[row] = np.einsum("vxy,vy->vx", blended[:, :, :3], body.points[chosen]) + blended[:, :, 3]
        turned[row] = np.einsum("vxy,vy->vx", blended[:, :, :3], normals)
    return points, turned / np.linalg.norm(turned, axis=-1, keepdims=True)
