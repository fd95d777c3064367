# SPDX-License-Identifier: Apache-2.0
"""How deep hair is in the body, where the body has open edges."""

import numpy as np
from pxr import UsdGeom, UsdSkel, Vt

from usd.baking.bake import bake
from usd.review.depths import _frames
from usd.review.evaluate import evaluate

from ..shots import RIG, edited


def shoulder_cape(stage) -> None:
    """A sheet that faces up, just below the tips, and around the chest's top."""
    turn, far = np.meshgrid(np.arange(24) * np.pi / 12, np.linspace(0.05, 0.4, 10), indexing="ij")
    points = np.stack([far * np.sin(turn), np.full(far.shape, 1.47), far * np.cos(turn)], -1)
    inner = np.arange(240).reshape(24, 10)
    after = np.roll(inner, -1, 0)
    worn(stage, "/Hero/Cape", points, np.stack([inner[:, :-1], inner[:, 1:], after[:, 1:], after[:, :-1]], -1), 1)


def open_locks(stage) -> None:
    """Mesh hair on the neck: eight upright tubes, open at both ends, below the tips."""
    turn, around = np.meshgrid(np.arange(8) * np.pi / 4, np.arange(6) * np.pi / 3, indexing="ij")
    x = 0.17 * np.sin(turn) + 0.04 * np.sin(around)
    z = 0.17 * np.cos(turn) + 0.04 * np.cos(around)
    points = np.concatenate([np.stack([x, np.full(x.shape, height), z], -1) for height in (1.39, 1.43)])
    low = np.arange(48).reshape(8, 6)
    faces = np.stack([low, np.roll(low, -1, 1), np.roll(low, -1, 1) + 48, low + 48], -1)
    worn(stage, "/Hero/Locks", points, faces, 2)


def worn(stage, path: str, points: np.ndarray, faces: np.ndarray, joint: int) -> None:
    """A mesh of points (..., 3) [m] and faces (..., 4) that one joint moves."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.reshape(-1, 3).astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([4] * (faces.size // 4))
    mesh.CreateFaceVertexIndicesAttr(faces.ravel().tolist())
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([RIG])
    binding.CreateJointIndicesPrimvar(True, 1).Set([joint])
    binding.CreateJointWeightsPrimvar(True, 1).Set([1.0])


def test_hair_before_an_open_end_of_mesh_hair_is_in_no_body(tmp_path, still_model):
    """It seemed as deep in the lock as it is far from it."""
    shot = edited(tmp_path, open_locks)
    bake(shot, tmp_path / "hair.usdc", still_model, resolve=False)
    assert evaluate(tmp_path / "hair.usdc").grooms["/Hero/Hair"]["penetration_worst_mm"] < 5


def test_hair_that_goes_through_a_cape_is_as_deep_in_it_as_it_is(tmp_path, still_model):
    """A sheet encloses nothing, but who goes through its middle is not beyond its edge."""
    shot = edited(tmp_path, shoulder_cape)
    bake(shot, tmp_path / "hair.usdc", still_model, resolve=False)
    assert evaluate(tmp_path / "hair.usdc").grooms["/Hero/Hair"]["penetration_worst_mm"] > 20


def test_each_groom_is_also_measured_where_it_seems_deepest():
    rough = np.zeros((200, 2))
    rough[[50, 120, 121, 140], 0] = -0.01, -0.02, -0.03, -0.04
    rough[[3, 60, 199], 1] = -0.01, -0.02, -0.03
    even, (first, second) = _frames(rough)
    assert len(even) == 32 and even[0] == 0 and even[-1] == 199
    assert np.array_equal(first[:32], even) and set(first[32:]) == {120, 121, 140} - set(even)
    assert set(second[32:]) == {3, 60, 199} - set(even) and 3 in second
