# SPDX-License-Identifier: Apache-2.0
"""What a bake tells: of what changes nothing, of bodies that it cannot use, and of files that it must not write over."""

import os

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models import model_file
from usd.baking.bake import bake
from usd.baking.join import join
from usd.baking.simulate import simulate
from usd.review.evaluate import evaluate
from usd.review.inspect import inspect
from usd.rig.bake import bake_rig
from usd.rig.stage import read_rigged_hair
from usd.shot.stage import read_shot

from ..rig_shots import model_for, small_shot
from ..shots import CENTRE, edited, write_shot


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


def test_what_the_shot_cannot_compose_either_is_not_said_to_be_lost_by_the_bakes_folder(tmp_path, still_model):
    """USD's words on a cycle name the stage's first layer, which is the bake's own."""
    shot = edited(tmp_path, lambda stage: stage.GetPrimAtPath("/Hero/Skin").GetInherits().AddInherit("/Hero"))
    (tmp_path / "cache").mkdir()
    notes = bake(shot, tmp_path / "cache" / "b.usdc", still_model, frames=[2]).notes
    assert any("Cycle" in note for note in notes) and not any("SEARCH_PATH" in note for note in notes)


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
