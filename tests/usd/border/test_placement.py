# SPDX-License-Identifier: Apache-2.0
"""A scale that cannot be used is told with the prim whose it is, not with the character, or a joint of it, far below."""

import pytest
from pxr import Gf, Usd, UsdGeom

from neuralocks_core.errors import NeuralocksError
from usd.border.placement import Placement
from usd.review.inspect import inspect
from usd.rig.bake import bake_rig
from usd.rig.stage import read_rigged_hair
from usd.shot.stage import read_shot

from ..rig_shots import model_for, small_shot
from ..shots import Recipe, edited


def _scaled(path: str, **samples):
    """An edit that scales a prim: by `at_1=(1, 2, 1)` and so on, otherwise by `still`."""

    def edit(stage):
        op = UsdGeom.Xformable(stage.GetPrimAtPath(path)).AddScaleOp()
        for name, scale in samples.items():
            op.Set(Gf.Vec3f(*scale), float(name.removeprefix("at_")) if name != "still" else Usd.TimeCode.Default())

    return edit


def _refused(path) -> str:
    with pytest.raises(NeuralocksError) as error:
        read_shot(path)
    assert str(error.value) in inspect(path)["stops"]
    return str(error.value)


@pytest.mark.parametrize(
    ("samples", "said"),
    [
        ({"still": (0, 0, 0)}, "has zero scale; give it a scale above zero, or hide"),
        ({"at_1": (1, 1, 1), "at_4": (0, 0, 0)}, "at time code 4 has zero scale; give it a scale above zero"),
        ({"still": (1, float("nan"), 1)}, "holds NaN or infinity; repair it"),
        ({"still": (-1, 1, 1)}, "is mirrored (negative scale); apply or remove"),
        ({"at_1": (1, 1, 1), "at_4": (-1, 1, 1)}, "is mirrored at time code 4 (negative scale); apply or remove"),
        ({"at_1": (1, 1, 1), "at_8": (1, 1, 1), "at_9": (1, -1, 1)}, "is mirrored"),
    ],
)
def test_the_prim_above_a_character_whose_scale_cannot_be_used_is_named(tmp_path, samples, said):
    shot = edited(tmp_path, _scaled("/Set/Group", **samples), Recipe(nesting="/Set/Group/Hero"))
    error = _refused(shot)
    assert error.startswith("/Set/Group/Hero/Rig: the transform of /Set/Group above it ") and said in error


def test_scales_that_are_zero_together_alone_name_no_single_prim(tmp_path):
    path = edited(tmp_path, _scaled("/Set/Group", still=(1e-5,) * 3), Recipe(nesting="/Set/Group/Hero"))
    stage = Usd.Stage.Open(str(path))
    _scaled("/Set", still=(1e-5,) * 3)(stage)
    stage.Save()
    assert "/Rig: its transform with those above it has zero scale" in _refused(path)


def test_what_a_reset_stack_shuts_out_is_not_named():
    stage = Usd.Stage.CreateInMemory()
    for path in ("/Top", "/Top/Apart", "/Top/Apart/Flat"):
        UsdGeom.Xform.Define(stage, path)
    _scaled("/Top", still=(0, 0, 0))(stage)
    apart = UsdGeom.Xformable(stage.GetPrimAtPath("/Top/Apart"))
    apart.SetResetXformStack(True)
    assert Placement(stage.GetPrimAtPath("/Top/Apart/Flat")).reference.trace() == 4
    _scaled("/Top/Apart/Flat", still=(1, 0, 1))(stage)
    with pytest.raises(NeuralocksError, match="^/Top/Apart/Flat: its transform has zero scale"):
        Placement(stage.GetPrimAtPath("/Top/Apart/Flat")).at(1.0)


def test_an_uneven_scale_above_is_not_that_of_a_hair_joint(tmp_path):
    """`inspect` says the same about a rig as its bake."""
    path = small_shot(tmp_path / "shot.usda")
    model = model_for(read_rigged_hair(path))
    stage = Usd.Stage.Open(str(path))
    _scaled("/Who", still=(1.2, 1, 1))(stage)
    stage.Save()
    said = "the transform of /Who above it is scaled unevenly, and hair joints below it cannot be; scale it evenly"
    with pytest.raises(NeuralocksError, match=f"^/Who/Rig: {said}"):
        bake_rig(path, tmp_path / "out.usda", model)
    assert any(f"/Who/Rig: would stop a rig bake: {said}" in line for line in inspect(path)["spoils"])
