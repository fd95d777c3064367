# SPDX-License-Identifier: Apache-2.0
"""Small rigs by hand."""

import numpy as np

from neuralocks_core.boundary_spec import BoundarySpec
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.rig import RigModel, SkinnedMesh, find_chains, rig_spec
from neuralocks_core.rig.network import held_features
from neuralocks_core.rotation import from_quaternion
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


def skin(who: Character, joints: dict[str, tuple]) -> SkinnedMesh:
    """One triangle of skin per joint name, at the points given (3, 3)."""
    leaves = [name.rsplit("/", 1)[-1] for name in who.skeleton.names]
    points = np.concatenate([np.asarray(p, float).reshape(3, 3) for p in joints.values()])
    indices = np.repeat([leaves.index(name) for name in joints], 3)[:, None]
    triangles = np.arange(len(points)).reshape(-1, 3)
    return SkinnedMesh("mesh", points, triangles, indices, np.ones_like(indices, float))


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
