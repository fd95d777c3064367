# SPDX-License-Identifier: Apache-2.0
"""Small rigs by hand."""

from dataclasses import replace

import numpy as np
import trimesh

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.rig import RigModel, find_chains, rig_spec
from neuralocks_core.rig.network import held_features
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.rotation import from_quaternion
from neuralocks_core.skinned_body import Body
from tests.rig_models import random_rig_model


def character(extra=(), turn=None) -> Character:
    """Hips, chest, neck, head and joints (name, parent, position); every orient is `turn` (3, 3) if given."""
    rows = [("hips", "", (0, 1, 0)), ("chest", "hips", (0, 1.3, 0)), ("neck", "chest", (0, 1.45, 0))]
    rows += [("head", "neck", (0, 1.55, 0))]
    for side, sign in (("left", 1), ("right", -1)):
        rows += [
            (f"{side}_upper_arm", "chest", (0.18 * sign, 1.4, 0)),
            (f"{side}_lower_arm", f"{side}_upper_arm", (0.45 * sign, 1.4, 0)),
        ]
    rows += list(extra)
    paths, parents, bind = {}, [], []
    for name, parent, place in rows:
        parents.append(list(paths).index(parent) if parent else -1)
        paths[name] = f"{paths[parent]}/{name}" if parent else name
        matrix = np.eye(4)
        matrix[:3, :3] = np.eye(3) if turn is None else turn
        matrix[:3, 3] = place
        bind.append(matrix)
    return Character(Skeleton(tuple(paths.values()), np.array(parents), np.array(bind)))


def tail(name="hair", joints=3, at=(0, 1.6, -0.1), step=(0, -0.06, -0.01), parent="head"):
    """Joints of one straight chain."""
    rows = []
    for i in range(joints):
        rows.append((f"{name}_{i + 1}", rows[-1][0] if rows else parent, tuple(np.add(at, np.multiply(i, step)))))
    return rows


def branched() -> HairRig:
    """A chain that forks, with a few skinned points."""
    fork = tail("hair_a", 3, at=(0.05, 1.44, -0.1), parent="hair_2")
    fork += tail("hair_b", 3, at=(-0.05, 1.44, -0.1), parent="hair_2")
    who = character([*tail("hair", 2), *fork])
    chains = find_chains(who)
    rng = np.random.default_rng(0)
    weights = rng.random((7, len(chains) + 1))
    return HairRig(who, chains, rng.normal(0, 0.1, (7, 3)), weights / weights.sum(1, keepdims=True))


def with_balls(fine: int = 3) -> tuple[HairRig, float]:
    """A body of two balls, around the head and in the chest, each a `fine` times divided icosahedron, and a hanging chain; and their
    radius.
    """
    rig = branched()
    who, radius = rig.character, 0.12
    ball = trimesh.creation.icosphere(fine, radius)
    names = [name.rsplit("/", 1)[-1] for name in who.skeleton.names]
    points = np.concatenate([ball.vertices + (0, 1.62, 0.02), ball.vertices + (0, 1.3, 0)])
    faces = np.concatenate([ball.faces, ball.faces + len(ball.vertices)])
    joints = np.repeat([names.index("head"), names.index("chest")], len(ball.vertices))[:, None]
    return replace(rig, character=replace(who, body=Body(points, faces, joints, np.ones_like(joints, float)))), radius


def skin(who: Character, joints: dict[str, tuple]) -> Body:
    """One triangle of skin per joint name, at the points given (3, 3)."""
    leaves = [name.rsplit("/", 1)[-1] for name in who.skeleton.names]
    points = np.concatenate([np.asarray(p, float).reshape(3, 3) for p in joints.values()])
    indices = np.repeat([leaves.index(name) for name in joints], 3)[:, None]
    triangles = np.arange(len(points)).reshape(-1, 3)
    return Body(points, triangles, indices, np.ones_like(indices, float))


def steered(leaf, next_leaf=True):
    """A chain of three controls, each with a joint at its own place that drives its bone's skin, and that skin."""
    rows, skins = [], {}
    for i, (name, parent, place) in enumerate(tail("phys", 3)):
        rows += [(name, parent, place), (f"{leaf}_{i + 1}", name, place if i != 1 or next_leaf else (0, 1.5, -0.2))]
        skins[f"{leaf}_{i + 1}"] = [place, np.add(place, (0, -0.03, -0.005)), np.add(place, (0, -0.06, -0.01))]
    return character(rows), skins


def ring(who: Character, joint: str, size=1.0) -> Body:
    """Skin around the head, which a joint drives."""
    points = np.stack([np.cos(np.arange(12)), np.full(12, 1.65), np.sin(np.arange(12))], axis=-1)
    mesh = skin(who, {joint: points[:3]})
    indices = np.full((12, 1), mesh.joint_indices[0, 0])
    points = points * [0.1 * size, 1, 0.1 * size]
    return replace(mesh, points=points, joint_indices=indices, joint_weights=np.ones((12, 1)), triangles=[])


def random_model(joints=(4, 4, 4, 4), hidden=16, seed=0, spec: BoundarySpec | None = None) -> RigModel:
    """Chains of these lengths and a network of random weights, without a trained meaning."""
    rows = []
    for c, count in enumerate(joints):
        rows += tail(f"hair_{c}", count + 1, at=(0.1 * np.cos(c), 1.6, 0.1 * np.sin(c)))
    return random_rig_model(find_chains(character(rows)), rig_spec() if spec is None else spec, hidden, seed)


def model_of(kind) -> RigModel:
    """Random weights, or the shipped model's; "odd" sizes fill no vector unit."""
    if kind == "shipped":
        return RigModel.load()
    if kind == "odd":
        return random_model((1, 2, 4, 6), 13, 0, rig_spec(True))
    return random_model((4,) * 4, 16 + 16 * (kind == "dynamic"), 0, rig_spec(kind == "dynamic"))


def random_features(model, count, seed=1):
    """Features of random held poses, and a random history."""
    rng = np.random.default_rng(seed)
    relative = from_quaternion(rng.normal(size=(count, 2, 4)))
    gravity = rng.normal(size=(count, 3))
    features = held_features(model.spec, relative, gravity / np.linalg.norm(gravity, axis=1, keepdims=True))
    features[:, 15:] = rng.normal(0, 0.5, features[:, 15:].shape)
    return features
