# SPDX-License-Identifier: Apache-2.0
"""Grooms of one head are posed together, and each comes out as if it were alone."""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdSkel, Vt

import usd.baking.batches as batches
import usd.shot.search.hair_search as hair_search
import usd.shot.stage as stage_reading
from neuralocks_core.deformation.resolve import Resolver
from usd.baking.bake import bake
from usd.baking.groom_models import GroomModels
from usd.review.baked import read_baked
from usd.review.evaluate import evaluate
from usd.shot.stage import read_shot

from ..shots import Recipe, samples, write_shot

LENGTHS = 0.2, 1.0, 1.5
"""Hair length of each prim, relative to the recipe's: they reach different parts of the body."""


@pytest.fixture
def shot(tmp_path):
    """Hair in three prims, and stubble on the chest, which another joint carries."""
    path = write_shot(tmp_path, Recipe(strands=30, vertices=9))
    stage = Usd.Stage.Open(str(path))
    points = np.array(UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr().Get()).reshape(30, 9, 3)
    for name, rows, length in zip("ABC", np.split(np.arange(30), 3), LENGTHS):
        own = points[rows, :1] + length * (points[rows] - points[rows, :1])
        _curves(stage, f"/Hero/{name}", own, 3)
    _curves(stage, "/Hero/Stubble", [0, -0.3, 0] + points[:6, :1] + 0.2 * (points[:6] - points[:6, :1]), 2)
    stage.GetPrimAtPath("/Hero/Hair").SetActive(False)
    stage.Save()
    return path


def _curves(stage, path: str, points: np.ndarray, joint: int) -> None:
    curves = UsdGeom.BasisCurves.Define(stage, path)
    curves.CreateTypeAttr("linear")
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.reshape(-1, 3).astype(np.float32)))
    curves.CreateCurveVertexCountsAttr([points.shape[1]] * len(points))
    curves.CreateWidthsAttr([0.001])
    curves.SetWidthsInterpolation("constant")
    binding = UsdSkel.BindingAPI.Apply(curves.GetPrim())
    binding.CreateSkeletonRel().SetTargets(["/Hero/Rig"])
    binding.CreateJointIndicesPrimvar(True, 1).Set([joint])
    binding.CreateJointWeightsPrimvar(True, 1).Set([1.0])


def test_those_of_one_head_that_one_model_moves_are_together(shot, monkeypatch):
    def names(moved_by=lambda item: "a model"):
        return [[item.path[-1] for item in items] for items in batches.batches(read_shot(shot).grooms, moved_by)]

    assert names() == [["A", "B", "C"], ["e"]]
    assert names(lambda item: item.path == "/Hero/A") == [["A"], ["B", "C"], ["e"]]
    # Hair of one kind does not lie side by side in the stage.
    assert names(lambda item: item.path == "/Hero/B") == [["A", "C"], ["B"], ["e"]]
    monkeypatch.setattr(batches, "TOGETHER", 20)
    assert names() == [["A", "B"], ["C"], ["e"]]


@pytest.mark.parametrize("skeletons", [1, 2])
def test_a_character_is_looked_at_once_for_all_that_one_joint_carries(shot, monkeypatch, skeletons):
    if skeletons == 2:  # clothes, which become part of the body
        stage = Usd.Stage.Open(str(shot))
        layer = stage.GetRootLayer()
        for name in ("Rig", "Skin"):
            Sdf.CopySpec(layer, f"/Hero/{name}", layer, f"/Hero/Clothes{name}")
        UsdSkel.BindingAPI(stage.GetPrimAtPath("/Hero/ClothesSkin")).GetSkeletonRel().SetTargets(["/Hero/ClothesRig"])
        stage.Save()
    looks = {}
    for name in ("without_turn", "rig_notes", "untrained", "unevenly_scaled"):
        module = stage_reading if hasattr(stage_reading, name) else hair_search
        looks[name] = Mock(wraps=getattr(module, name))
        monkeypatch.setattr(module, name, looks[name])
    items = read_shot(shot).grooms
    assert [item.path[-1] for item in items] == ["A", "B", "C", "e"]
    assert len({item.attachment.character for item in items}) == 2
    seen = {name: [call.args[0].character.carrying_joint for call in look.mock_calls] for name, look in looks.items()}
    assert seen == {"without_turn": [3, 2], "rig_notes": [3, 3], "untrained": [3], "unevenly_scaled": [3, 2]}


@pytest.mark.parametrize("resolve", [True, False])
def test_each_is_moved_as_if_it_were_alone(shot, tmp_path, model, monkeypatch, resolve):
    together = bake(shot, tmp_path / "together.usdc", model, resolve=resolve).path
    monkeypatch.setattr(batches, "TOGETHER", 0)
    alone = bake(shot, tmp_path / "alone.usdc", model, resolve=resolve).path
    for name in ("A", "B", "C", "Stubble"):
        for kind, most in (("points", 1e-6), ("velocities", 1e-4)):
            one, other = (samples(path, kind, at=5.0, prim=f"/Hero/{name}") for path in (together, alone))
            assert np.abs(one - other).max() < most
        assert np.ptp([samples(together, "points", at=code, prim=f"/Hero/{name}") for code in (1.0, 5.0)], axis=0).any()


@pytest.mark.parametrize("alternating", [False, True])
def test_an_interrupted_bake_goes_on(shot, tmp_path, model, monkeypatch, alternating):
    out = tmp_path / "bake.usdc"
    if alternating:  # of A and C together, then B
        monkeypatch.setattr(
            GroomModels, "path", lambda self, item: self.asked.file.path.with_stem(str("B" in item.path))
        )
        monkeypatch.setattr(GroomModels, "of", lambda self, item: self.asked)
    whole = bake(shot, out, model).path.read_bytes()
    out.unlink()

    def stop(done, total, message):
        if done >= 9:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bake(shot, out, model, progress=stop)
    assert bake(shot, out, model).resumed == (10 if alternating else 9)  # a frame counts once for each groom of a batch
    assert out.read_bytes() == whole


def test_a_report_poses_the_body_once_for_all_of_a_head(shot, model, tmp_path, monkeypatch):
    stage = Usd.Stage.Open(str(shot))
    for name in "DE":
        Sdf.CopySpec(stage.GetRootLayer(), "/Hero/B", stage.GetRootLayer(), f"/Hero/{name}")
    stage.Save()
    baked = read_baked(bake(shot, tmp_path / "hair.usdc", model, velocities=False).path)
    collider = Mock(side_effect=Resolver.collider)
    monkeypatch.setattr(Resolver, "collider", lambda *args: collider(*args))
    together = evaluate(baked)
    assert [path[-1] for path in together.grooms] == ["A", "B", "C", "e", "D", "E"]
    resolvers = {id(call.args[0]) for call in collider.mock_calls}
    assert len(resolvers) < 6 and collider.call_count == len(resolvers) * len(baked.codes)
    for item in baked.shot.grooms:
        alone = evaluate(replace(baked, shot=replace(baked.shot, grooms=(item,))))
        np.testing.assert_equal(alone.grooms[item.path], together.grooms[item.path])
