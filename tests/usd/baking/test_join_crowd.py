# SPDX-License-Identifier: Apache-2.0
"""Parts by character, baked by the machines of a farm, are the one bake of a crowd."""

import pytest
from pxr import Sdf, Usd, UsdGeom

from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.baking.join import join

from ..shots import Recipe, write_shot


@pytest.fixture
def crowd(tmp_path):
    """Three characters of two grooms each, the first of them an instance."""
    layer = Sdf.Layer.FindOrOpen(str(write_shot(tmp_path, Recipe(bound="mesh", frames=12, strands=9), "hero")))
    Sdf.CopySpec(layer, "/Hero/Hair", layer, "/Hero/Beard")
    layer.Save()
    stage = Usd.Stage.CreateNew(str(tmp_path / "crowd.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(12)
    for number, name in enumerate(("Zoe", "Bob", "Ann")):
        prim = UsdGeom.Xform.Define(stage, f"/Set/{name}").GetPrim()
        prim.GetReferences().AddReference("./hero.usda", "/Hero")
        UsdGeom.Xformable(prim).AddTranslateOp().Set((3 * number, 0, 0))
        prim.SetInstanceable(name == "Zoe")
    stage.Save()
    return tmp_path / "crowd.usda"


def test_parts_by_character_are_the_one_bake_byte_for_byte(crowd, tmp_path, model):
    whole = bake(crowd, tmp_path / "whole.usdc", model)
    parts = []
    for name, ranges in (("Ann", ("7:12", "1:6")), ("Zoe", (None,)), ("Bob", ("1:2", "3:12"))):
        for number, frames in enumerate(ranges):
            out = tmp_path / f"{name}{number}.usdc"
            parts.append(bake(crowd, out, model, skeleton=f"/Set/{name}/Rig", frames=frames).path)
    joined = join(parts, tmp_path / "hair.usdc")
    assert joined.grooms == [groom["path"] for groom in whole.grooms] and len(joined.grooms) == 6
    assert joined.path.read_bytes() == whole.path.read_bytes() and not joined.notes
    rest = bake(crowd, tmp_path / "rest.usdc", model, frames="3:12").path
    assert join([parts[2], rest], tmp_path / "hair.usdc").notes == [
        f"/Set/{name}: no part has samples before 3" for name in ("Bob/Hair", "Bob/Beard", "Ann/Hair", "Ann/Beard")
    ]
    bake(crowd, tmp_path / "other.usdc", model, material=["stiffness=2x"])
    with pytest.raises(
        NeuralocksError, match="other.usdc: /Set/.* was baked with different material than in .*Zoe0.usdc"
    ):
        join([*parts, tmp_path / "other.usdc"], tmp_path / "hair.usdc")
