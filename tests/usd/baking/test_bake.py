# SPDX-License-Identifier: Apache-2.0
"""The bake's contract: what it authors, and that units, axes and places do not matter."""

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdSkel, UsdValidation

from usd.baking.bake import bake
from usd.border.stage_files import open_stage
from usd.shot.bakes.bake_record import CARRIER
from usd.skel.binding import FORMER

from ..shots import HEAD, Recipe, samples, strand_points, world_points, write_shot


@pytest.fixture(scope="module")
def baked(tmp_path_factory, model):
    folder = tmp_path_factory.mktemp("bake")
    shot = write_shot(folder)
    return shot, bake(shot, folder / "bake.usdc", model)


def test_the_layer_holds_samples_and_nothing_else(baked):
    shot, result = baked
    layer = Sdf.Layer.FindOrOpen(str(result.path))
    assert list(layer.subLayerPaths) == ["./shot.usda"]
    hair = layer.GetPrimAtPath("/Hero/Hair")
    assert set(hair.properties.keys()) == {"points", "velocities", "extent", "skel:skeleton", FORMER, CARRIER}
    assert all(p.specifier == Sdf.SpecifierOver for p in (hair, layer.GetPrimAtPath("/Hero")))
    assert all(hair.attributes[n].default is None for n in ("points", "velocities", "extent"))
    assert layer.ListTimeSamplesForPath("/Hero/Hair.points") == [float(t) for t in range(1, 10)]
    stage, source = Usd.Stage.Open(layer), open_stage(shot)
    for key in (
        "metersPerUnit",
        "upAxis",
        "timeCodesPerSecond",
        "framesPerSecond",
        "defaultPrim",
        "startTimeCode",
        "endTimeCode",
    ):
        assert stage.GetMetadata(key) == source.GetMetadata(key), key
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    for time_code in (1.0, 5.0):
        assert len(curves.GetPointsAttr().Get(time_code)) == sum(curves.GetCurveVertexCountsAttr().Get())
        low, high = np.asarray(curves.GetExtentAttr().Get(time_code))
        points = np.asarray(curves.GetPointsAttr().Get(time_code))
        assert (low <= points.min(0)).all() and (high >= points.max(0)).all()
    rest = UsdGeom.BasisCurves(source.GetPrimAtPath("/Hero/Hair")).GetPointsAttr().Get()
    assert np.array_equal(curves.GetPointsAttr().Get(), rest)


def test_a_shot_whose_frames_lie_between_whole_numbers_is_baked_at_its_own(baked, model, tmp_path):
    """Otherwise it would have no sample at its first and last frame, where the hair would leave the head."""
    shot, result = baked
    stage = Usd.Stage.CreateNew(str(tmp_path / "later.usda"))
    stage.GetRootLayer().subLayerPaths.append(str(shot))
    stage.GetRootLayer().subLayerOffsets[0] = Sdf.LayerOffset(0.5)
    for key in ("metersPerUnit", "upAxis", "timeCodesPerSecond"):
        stage.SetMetadata(key, open_stage(shot).GetMetadata(key))
    stage.SetStartTimeCode(1.5)
    stage.SetEndTimeCode(9.5)
    stage.Save()
    later = bake(tmp_path / "later.usda", tmp_path / "hair.usda", model)
    assert later.frames == [frame + 0.5 for frame in result.frames]
    stages = [Usd.Stage.Open(str(path)) for path in (result.path, later.path)]
    plain, hair = (UsdGeom.BasisCurves.Get(each, "/Hero/Hair").GetPointsAttr() for each in stages)
    for frame in (1.0, 9.0):
        assert np.allclose(plain.Get(frame), hair.Get(frame + 0.5), atol=1e-5)


def test_validators_find_nothing(baked, tmp_path, model):
    mesh = bake(write_shot(tmp_path, Recipe(bound="mesh", unit=0.01, up="Z")), tmp_path / "mesh.usda", model)
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    for path in (baked[1].path, mesh.path):
        assert [f"{e.GetName()}: {e.GetMessage()}" for e in context.Validate(Usd.Stage.Open(str(path)))] == []


def test_usd_skel_leaves_baked_hair_alone(baked):
    stage = Usd.Stage.Open(str(baked[1].path))
    root, cache = UsdSkel.Root(stage.GetPrimAtPath("/Hero")), UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    skinned = [
        str(query.GetPrim().GetPath())
        for binding in cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate)
        for query in binding.GetSkinningTargets()
    ]
    assert skinned == ["/Hero/Skin"]


def test_hair_that_the_network_leaves_still_follows_the_skin_as_usd_skel_does(tmp_path, still_model):
    shot = write_shot(tmp_path)
    result = bake(shot, tmp_path / "still.usdc", still_model)
    stage = open_stage(shot)
    skeleton = UsdSkel.Cache()
    skeleton.Populate(UsdSkel.Root(stage.GetPrimAtPath("/Hero")), Usd.PrimDefaultPredicate)
    query = skeleton.GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath("/Hero/Rig")))
    rest = strand_points(40, 12).reshape(-1, 3)
    for code in (1.0, 4.0, 7.5):
        matrix = np.array(query.ComputeSkinningTransforms(code)[HEAD]).T
        expected = rest @ matrix[:3, :3].T + matrix[:3, 3]
        frames = bake(shot, tmp_path / "one.usdc", still_model, frames=[code]) if code % 1 else result
        assert np.abs(world_points(frames.path, code) - expected).max() < 2e-6
    # In the bind pose, the author's exact bits come back.
    assert np.array_equal(samples(result.path, "points", at=1.0), samples(shot, "points"))


@pytest.mark.parametrize(
    "recipe",
    [
        Recipe(unit=0.01),
        Recipe(up="Z"),
        Recipe(unit=0.01, up="Z", bound="mesh"),
        Recipe(unit=0.0254, nesting="/World/Set/Hero", bound="mesh"),
        Recipe(unit=0.01, bound="none"),
        Recipe(skel_root=False, basis="bspline"),
    ],
    ids=["cm", "z_up", "cm_z_up_on_mesh", "inch_nested", "cm_by_name", "no_skel_root_cubic"],
)
def test_units_axes_and_nesting_do_not_matter(baked, tmp_path, model, recipe):
    result = bake(write_shot(tmp_path, recipe), tmp_path / "bake.usdc", model)
    for code in (1.0, 6.0):
        here = world_points(result.path, code, f"{recipe.nesting}/Hair")
        # Without skin, the head's centre is an average one, which changes the network's inputs.
        tolerance = 2e-2 if recipe.bound == "none" else 5e-5
        assert np.abs(here - world_points(baked[1].path, code)).max() < tolerance


@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_a_placed_and_scaled_character_moves_as_it_would_in_place(baked, tmp_path, model, scale):
    turn = np.eye(4)
    turn[:3, :3] = scale * np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    turn[:3, 3] = 5, 0, -3
    recipe = Recipe(place=turn, bound="mesh")
    # A character a hundredth of the size is scaled up again by its unit, as in files exported from centimetres.
    shot = write_shot(tmp_path, recipe)
    if scale != 1.0:
        stage = Usd.Stage.Open(str(shot))
        UsdGeom.SetStageMetersPerUnit(stage, 1 / scale)
        stage.GetRootLayer().Save()
    result = bake(shot, tmp_path / "bake.usdc", model)
    for code in (1.0, 6.0):
        here = world_points(result.path, code) - turn[:3, 3] / scale
        back = here @ (turn[:3, :3] / scale)
        assert np.abs(back - world_points(baked[1].path, code)).max() < 1e-4


def test_a_moving_root_moves_the_hair_and_its_history(tmp_path, model):
    shots = []
    for name, moving in (("still", False), ("moved", True)):
        path = write_shot(tmp_path, Recipe(bound="mesh"), name)
        stage = Usd.Stage.Open(str(path))
        op = UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddTranslateOp()
        for frame in range(1, 10):
            op.Set((0.02 * (frame - 1) ** 2 if moving else 0.0, 0, 0), frame)
        stage.GetRootLayer().Save()
        shots.append(bake(path, tmp_path / f"{name}.usdc", model).path)
    shift = world_points(shots[1], 9.0) - world_points(shots[0], 9.0)
    assert np.abs(np.median(shift[:, 0]) - 0.02 * 64) < 0.05
    assert np.ptp(shift, axis=0).max() > 1e-3  # acceleration changes the hair, not only its place


def test_frames_of_an_earlier_bake_that_a_new_one_hides_are_said(tmp_path, baked, still_model):
    _, whole = baked
    for frames, told in (("3:5", True), ("1:9", False), (None, False), ("1:9:4", False)):
        notes = bake(whole.path, tmp_path / "retake.usdc", still_model, frames=frames).notes
        assert any("/Hero/Hair: is baked already at time codes 1 to 9" in note for note in notes) == told


def test_material_and_strength_reach_the_network(tmp_path, model):
    shot = write_shot(tmp_path)
    plain = world_points(bake(shot, tmp_path / "a.usdc", model, frames=[6]).path, 6.0)
    stiff = world_points(bake(shot, tmp_path / "b.usdc", model, frames=[6], material=["bend=5x"]).path, 6.0)
    held = world_points(bake(shot, tmp_path / "c.usdc", model, frames=[6], strength=0).path, 6.0)
    assert np.abs(stiff - plain).max() > 1e-4 and np.abs(held - plain).max() > 1e-4


def test_a_bake_of_a_bake_is_the_bake(baked, tmp_path, model):
    again = bake(baked[1].path, tmp_path / "again.usdc", model, frames=[5])
    assert np.abs(world_points(again.path, 5.0) - world_points(baked[1].path, 5.0)).max() < 1e-6


def test_a_groom_inside_an_instance_is_baked(tmp_path, model):
    write_shot(tmp_path, name="asset")
    stage = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    UsdGeom.SetStageUpAxis(stage, "Y")
    for name in ("A", "B"):
        prim = stage.DefinePrim(f"/{name}")
        prim.GetReferences().AddReference("./asset.usda")
        prim.SetInstanceable(True)
    stage.SetDefaultPrim(stage.GetPrimAtPath("/A"))
    stage.GetRootLayer().Save()
    result = bake(tmp_path / "shot.usda", tmp_path / "bake.usdc", model, frames=[3])
    assert [g["path"] for g in result.grooms] == ["/A/Hair", "/B/Hair"]
    assert np.array_equal(world_points(result.path, 3.0, "/A/Hair"), world_points(result.path, 3.0, "/B/Hair"))


def test_numbers_of_numpy_are_numbers(tmp_path, model):
    """As scripts have them."""
    shot, files = write_shot(tmp_path), []
    for number, strength in enumerate((0.5, np.float32(0.5))):
        files.append(bake(shot, tmp_path / f"{number}.usdc", model, strength=strength, subframes=np.int64(1)).path)
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.parametrize("stated", [{"end": 48}, {"start": -12}, {"start": 60}])
@pytest.mark.parametrize("frames", [None, "2:5"])
def test_a_range_of_which_a_shot_states_one_end_keeps_it(stated, frames, tmp_path, model):
    shot = write_shot(tmp_path)
    layer = Sdf.Layer.FindOrOpen(str(shot))
    for name, value in (("startTimeCode", stated.get("start")), ("endTimeCode", stated.get("end"))):
        layer.pseudoRoot.ClearInfo(name)
        if value is not None:
            layer.pseudoRoot.SetInfo(name, float(value))
    layer.Save()
    stage = Usd.Stage.Open(str(bake(shot, tmp_path / "hair.usda", model, frames=frames).path))
    first, last = (1, 9) if frames is None else (2, 5)
    wanted = stated.get("start", first), max(stated.get("end", last), stated.get("start", last))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == wanted
