# SPDX-License-Identifier: Apache-2.0
"""How deep hair is in the body, where the body has open edges."""

import numpy as np
from pxr import UsdGeom, UsdSkel, Vt

from usd.baking.bake import bake
from usd.review.evaluate import evaluate

from ..shots import RIG, edited


def open_locks(stage) -> None:
    """Mesh hair on the neck: eight upright tubes, open at both ends, below the tips."""
    turn, around = np.meshgrid(np.arange(8) * np.pi / 4, np.arange(6) * np.pi / 3, indexing="ij")
    x = 0.17 * np.sin(turn) + 0.04 * np.sin(around)
    z = 0.17 * np.cos(turn) + 0.04 * np.cos(around)
    points = np.concatenate([np.stack([x, np.full(x.shape, height), z], -1) for height in (1.39, 1.43)])
    low = np.arange(48).reshape(8, 6)
    faces = np.stack([low, np.roll(low, -1, 1), np.roll(low, -1, 1) + 48, low + 48], -1)
    mesh = UsdGeom.Mesh.Define(stage, "/Hero/Locks")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.reshape(-1, 3).astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([4] * 48)
    mesh.CreateFaceVertexIndicesAttr(faces.ravel().tolist())
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([RIG])
    binding.CreateJointIndicesPrimvar(True, 1).Set([2])
    binding.CreateJointWeightsPrimvar(True, 1).Set([1.0])


def test_hair_before_an_open_end_of_mesh_hair_is_in_no_body(tmp_path, still_model):
    """It seemed as deep in the lock as it is far from it."""
    shot = edited(tmp_path, open_locks)
    bake(shot, tmp_path / "hair.usdc", still_model, resolve=False)
    assert evaluate(tmp_path / "hair.usdc").grooms["/Hero/Hair"]["penetration_worst_mm"] < 5
