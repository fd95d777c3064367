# SPDX-License-Identifier: Apache-2.0
"""The bake's contract: what it authors, and that units, axes and places do not matter."""

import os

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdSkel, UsdValidation

from neuralocks_core import model as model_file
from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.baking.join import join
from usd.baking.simulate import simulate
from usd.border.stage_files import open_stage
from usd.review.evaluate import evaluate
from usd.review.inspect import inspect
from usd.rig.bake import bake_rig
from usd.rig.stage import read_rigged_hair
from usd.shot.stage import read_shot
from usd.skel.binding import FORMER

from ..rig_shots import model_for, small_shot
from ..shots import CENTRE, HEAD, Recipe, samples, strand_points, world_points, write_shot


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
    assert set(hair.properties.keys()) == {"points", "velocities", "extent", "skel:skeleton", FORMER}
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


def test_sliders_that_a_model_never_heard_of_are_said(tmp_path, still_model):
    known, shot = model_file.read(still_model), write_shot(tmp_path)
    meta = known.meta | {"training": {"options": {"random_materials": False}}}
    one = model_file.write(tmp_path / "one.neuralocks", meta, known.graphs)

    def notes(which, **options):
        return bake(shot, tmp_path / "b.usdc", which, frames=[2], **options).notes

    assert any("weight and damping change nothing" in note for note in notes(one, material={"damping": 20}))
    forged = model_file.write(tmp_path / "forged.neuralocks", known.meta | {"training": {"options": 3}}, known.graphs)
    for which, options in (
        (forged, {"material": {"damping": 20}}),
        (one, {}),
        (one, {"material": {"clumping": 60}}),
        (still_model, {"material": "weight=2"}),
    ):
        assert not any("change nothing" in note for note in notes(which, **options))


def test_frames_of_an_earlier_bake_that_a_new_one_hides_are_said(tmp_path, baked, still_model):
    _, whole = baked
    for frames, told in (("3:5", True), ("1:9", False), (None, False), ("1:9:4", False)):
        notes = bake(whole.path, tmp_path / "retake.usdc", still_model, frames=frames).notes
        assert any("/Hero/Hair: is baked already at time codes 1 to 9" in note for note in notes) == told


def test_frames_without_animation_are_said(tmp_path, still_model):
    """A shot at 1001 whose animation stayed at 1: no file has an error, and nothing moves."""
    shot = write_shot(tmp_path)
    for frames, told in (("5:12", False), ("9", False), ("8:20", True)):
        notes = bake(shot, tmp_path / "a.usdc", still_model, frames=frames).notes
        assert any("little of it within 8 to 20: elsewhere a held pose" in note for note in notes) == told
    assert any("1 to 9" in note for note in bake(shot, tmp_path / "b.usdc", still_model, frames="1001:1003").notes)
    stage = Usd.Stage.Open(str(shot))
    stage.SetStartTimeCode(1001)
    stage.SetEndTimeCode(1048)
    stage.GetRootLayer().Save()
    assert any("layer offsets" in note for note in inspect(shot)["spoils"])


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


def test_a_character_whose_body_has_no_surface_is_named(tmp_path, model):
    """Of several, nobody knew which."""
    shot = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(shot))
    (mesh,) = (UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh))
    mesh.GetPointsAttr().Set([CENTRE.tolist()] * len(mesh.GetPointsAttr().Get()))
    stage.Save()
    with pytest.raises(NeuralocksError, match="^/Hero/Rig: body: its mesh has no triangle with an area"):
        bake(shot, tmp_path / "out.usdc", model)
    with pytest.raises(NeuralocksError, match="^/Hero/Rig: body: its mesh has no triangle with an area"):
        simulate(shot, tmp_path / "out.usdc", strands=4)
    flat = bake(shot, tmp_path / "out.usdc", model, resolve=False)
    with pytest.raises(NeuralocksError, match="^/Hero/Rig: body: its mesh has no triangle with an area"):
        evaluate(flat.path)


def test_a_bake_that_does_not_find_the_shots_parts_from_its_own_folder_is_told_so(tmp_path, still_model):
    """USD also looks for names without ./ in the folder of the stage's first layer."""
    for name in ("show", "layout", "cache"):
        (tmp_path / name).mkdir()
    write_shot(tmp_path / "show", name="hero")
    (tmp_path / "layout" / "set.usda").write_text('#usda 1.0\ndef "Hero" (references = @hero.usda@</Hero>)\n{\n}\n')
    shot = tmp_path / "show" / "shot.usda"
    shot.write_text("#usda 1.0\n(\n  metersPerUnit = 1\n  subLayers = [@../layout/set.usda@]\n)\n")
    notes = {name: bake(shot, tmp_path / name / "b.usdc", still_model, frames=[2]).notes for name in ("show", "cache")}
    assert not any("hero.usda" in note for note in notes["show"])
    assert any("hero.usda" in note and "SEARCH_PATH" in note for note in notes["cache"])


def test_a_bake_over_its_own_shot_is_refused(tmp_path, model):
    shot = write_shot(tmp_path)
    with pytest.raises(NeuralocksError, match="is read as well"):
        bake(shot, shot, model)
    read = read_shot(shot)
    assert np.abs(read.grooms[0].groom.points.mean(0) - CENTRE).max() < 0.2
    assert os.listdir(tmp_path) == ["shot.usda"]


def test_a_file_of_another_variant_of_the_shot_is_not_written_over(tmp_path, still_model):
    base, other = (write_shot(tmp_path, name=name) for name in ("base", "longhair"))
    stage = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    variants = stage.DefinePrim("/Hero", "SkelRoot").GetVariantSets().AddVariantSet("look")
    for path in (other, base):
        variants.AddVariant(path.stem)
        variants.SetVariantSelection(path.stem)
        with variants.GetVariantEditContext():
            stage.GetPrimAtPath("/Hero").GetReferences().AddReference(f"./{path.name}", "/Hero")
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    stage.Save()
    before = other.read_bytes()
    with pytest.raises(NeuralocksError, match="longhair.usda: shot.usda refers to it, as a layer or in a variant"):
        bake(tmp_path / "shot.usda", other, still_model, frames=[1])
    assert other.read_bytes() == before


def test_what_lies_over_a_shot_is_not_written_under_the_name_of_a_missing_layer_of_it(tmp_path, model):
    """Each would lie over the other: USD opens such files with an error, and the next bake would be of part of its own shot."""
    part = bake(write_shot(tmp_path, name="anim"), tmp_path / "part.usdc", model, frames=[2]).path
    shot, rig, out = tmp_path / "shot.usda", small_shot(tmp_path / "rig.usda"), tmp_path / "hair.usdc"
    shot.write_text(
        "#usda 1.0\n(\n  metersPerUnit = 1\n  subLayers = [@./hair.usdc@, @./anim.usda@, @./rig.usda@]\n)\n"
    )
    stage = Usd.Stage.Open(str(part))
    stage.GetRootLayer().subLayerPaths[0] = "./shot.usda"
    stage.GetRootLayer().Save()
    rig_model = model_for(read_rigged_hair(rig))
    for work in (lambda: bake(shot, out, model), lambda: bake_rig(shot, out, rig_model), lambda: join([part], out)):
        with pytest.raises(NeuralocksError, match=r"hair\.usdc: shot\.usda has it as a layer, and"):
            work()
    assert not out.exists() and not list(tmp_path.glob(".*"))


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
