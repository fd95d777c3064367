# SPDX-License-Identifier: Apache-2.0
"""Notes on a character that lies down in its bind pose, or has no body or an unusual one, and on a stage that states neither axis
nor unit.
"""

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

from usd.rig.notes import rigged_notes
from usd.shot.stage import read_shot

from ..commands import spoils
from ..shots import CENTRE, JOINTS, Recipe, add_curves, write_shot

LIES = "/Hero/Rig: lies down in its bind pose"
ELBOWS = {"left_lower_arm": "arm_twist_L", "right_lower_arm": "arm_twist_R"}


def _said(path, words) -> list[str]:
    """The notes with these words, the same for a bake and for `inspect`."""
    noted, told = ([note for note in notes if words in note] for notes in (read_shot(path).notes, spoils(path)))
    assert noted == told
    return noted


def _without(path, name):
    stage = Usd.Stage.Open(str(path))
    stage.ClearMetadata(name)
    stage.Save()
    return path


@pytest.mark.parametrize("up, lying", [("Y", 0), ("Z", 1)])
def test_a_character_that_lies_by_a_stages_silence_is_told(tmp_path, up, lying):
    path = write_shot(tmp_path, Recipe(up=up))
    assert not _said(path, "lies down")
    said = _said(_without(path, "upAxis"), "lies down")
    assert len(said) == lying and set(said) <= set(rigged_notes(read_shot(path).rigs[0]))
    assert all(note.startswith(LIES) and "no upAxis, so Y is up: author it" in note for note in said)


def test_skin_that_usdskel_shows_elsewhere_is_told(tmp_path):
    """Its weights do not sum to one; bakes of strands were silent."""
    path = write_shot(tmp_path)
    assert not _said(path, "do not sum to one")
    stage = Usd.Stage.Open(str(path))
    (mesh,) = (prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh))
    weights = UsdSkel.BindingAPI(mesh).GetJointWeightsPrimvar()
    weights.Set(0.8 * np.array(weights.Get(), np.float32))
    stage.Save()
    (note,) = _said(path, "do not sum to one")
    assert note.startswith(f"{mesh.GetPath()}: weights of ") and "UsdSkel shows these vertices elsewhere" in note


def test_a_character_referenced_with_another_axis_is_told_until_it_is_turned(tmp_path):
    write_shot(tmp_path, Recipe(up="Z"), "asset")
    stage = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    UsdGeom.SetStageUpAxis(stage, "Y")
    stage.DefinePrim("/Hero").GetReferences().AddReference("./asset.usda")
    stage.Save()
    (said,) = _said(tmp_path / "shot.usda", "lies down")
    assert said.startswith(LIES) and "asset.usda has Z up, the stage Y" in said and "needs a transform" in said
    UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddRotateXOp().Set(-90.0)
    stage.Save()
    assert not _said(tmp_path / "shot.usda", "lies down")


def test_a_unit_that_no_layer_says_is_told(tmp_path):
    path = write_shot(tmp_path, Recipe(unit=0.01), "asset")
    shot = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    shot.GetRootLayer().subLayerPaths.append("./asset.usda")
    shot.Save()
    assert not _said(tmp_path / "shot.usda", "metersPerUnit"), "the one that counts is the one that is meant"
    stage = Usd.Stage.Open(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    stage.Save()
    (said,) = _said(tmp_path / "shot.usda", "m, the stage in")
    assert "asset.usda counts in 1 m, the stage in 0.01 m" in said and not _said(
        tmp_path / "shot.usda", "no metersPerUnit"
    )
    assert len(_said(_without(path, "metersPerUnit"), "no metersPerUnit, so a unit counts as a centimetre")) == 1


NO_BODY = "/Hero/Rig: moves no visible mesh, so hair is kept out of no body and moves as on an average head; "


@pytest.mark.parametrize("bound", ["own", "none"])
def test_a_character_without_a_body_is_told(tmp_path, bound):
    path = write_shot(tmp_path, Recipe(bound=bound))
    if bound == "none":
        assert _said(path, "no body") == [NO_BODY + "bind its mesh to it"]
        return
    assert not _said(path, "no body")
    stage = Usd.Stage.Open(str(path))
    UsdGeom.Imageable(stage.GetPrimAtPath("/Hero/Skin")).MakeInvisible()
    stage.Save()
    assert _said(path, "no body") == [NO_BODY + "/Hero/Skin, bound to it, is not drawn: show the body"]


@pytest.mark.parametrize("up, unit", [("Y", 1.0), ("Z", 0.01)])
def test_a_body_that_is_a_point_cache_is_told_and_nothing_beside_it(tmp_path, up, unit):
    """As exported beside the skeleton that moved it."""
    path = write_shot(tmp_path, Recipe(up=up, unit=unit))
    stage = Usd.Stage.Open(str(path))
    skin = stage.GetPrimAtPath("/Hero/Skin")
    points, copy = UsdGeom.Mesh(skin).GetPointsAttr(), UsdGeom.Mesh.Define(stage, "/Set/Statue")
    UsdGeom.Xformable(copy).AddTranslateOp().Set((2 / unit, 0, 0))
    for code in range(1, 10):
        points.Set(Vt.Vec3fArray.FromNumpy(np.asarray(points.Get()) + np.float32(0.01 * (code - 1) / unit)), code)
    for mesh, name in ((copy, "points"), (copy, "faceVertexCounts"), (copy, "faceVertexIndices")):
        mesh.GetPrim().GetAttribute(name).Set(skin.GetAttribute(name).Get())
    for name in ("skel:skeleton", "primvars:skel:jointIndices", "primvars:skel:jointWeights"):
        skin.RemoveProperty(name)
    stage.Save()
    said = NO_BODY + "/Hero/Skin, around its head, is not bound to it: export the body with its weights"
    assert _said(path, "no body") == [said]


@pytest.mark.parametrize("size, told", [(1, 0), (1.1, 0), (1.8, 1), (4, 0)])
def test_a_head_larger_than_a_network_has_seen_is_told(tmp_path, size, told):
    path = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    points = UsdGeom.Mesh(stage.GetPrimAtPath("/Hero/Skin")).GetPointsAttr()
    values = np.array(points.Get())
    head = values[:, 1] > 1.5
    values[head] = CENTRE + size * (values[head] - CENTRE)
    points.Set(Vt.Vec3fArray.FromNumpy(values.astype(np.float32)))
    stage.Save()
    said = _said(path, "trained")
    assert len(said) == told and len(_said(path, "m wide")) == (size == 4)
    if told:
        assert said[0].startswith(
            "/Hero/Rig: its head height over its joint is 0.26 m (trained: 0.128 to 0.175), its head half"
        )


@pytest.mark.parametrize("wider", [1.0, 2.5])
def test_fur_beside_the_hair_says_nothing_false_of_the_head(tmp_path, wider):
    """Head size and neck are not judged at the joint that carries the fur: a chest may be too large for a head, or not a head's at
    all.
    """
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    hair = read_shot(path).notes
    stage = Usd.Stage.Open(str(path))
    skin = UsdGeom.Mesh(stage.GetPrimAtPath("/Hero/Skin")).GetPointsAttr()
    points = np.array(skin.Get())
    chest = points[:, 1] < 1.5
    points[chest, 0] *= wider
    skin.Set(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    low = points[chest & (points[:, 1] < 1.3)]
    add_curves(stage, "/Hero/Fur", np.stack([low, low + [0, 0, 0.02]], axis=1))
    stage.Save()
    for notes in (read_shot(path).notes, spoils(path)):
        assert set(notes) - set(hair) == {"/Hero/Fur: rides on 'spine', not on a head"}
    assert read_shot(path, head="spine").grooms[1].joint == "hips/spine"
    assert not any("rides on" in note for note in read_shot(path, head="spine").notes), (
        "its user says that it is the head"
    )


def test_arms_that_no_joint_continues_are_told_to_count_as_straight(tmp_path):
    path = write_shot(tmp_path, Recipe())
    assert not _said(path, "_lower_arm")
    path.write_text(path.read_text().replace("elbow_", "arm_2_"))
    assert not _said(path, "_lower_arm")
    assert read_shot(path).rigs[0].character.humanoid["left_lower_arm"] == JOINTS.index("hips/spine/arm_L/elbow_L")
    path.write_text(path.read_text().replace("arm_2_", "arm_twist_"))
    (said,) = _said(path, "_lower_arm")
    assert "left_lower_arm, right_lower_arm" in said and said.endswith("--joint left_lower_arm=JOINT")
    assert not any("_lower_arm" in note for note in read_shot(path, joints=ELBOWS).notes)


def test_a_joint_of_two_meanings_is_told(tmp_path):
    path = write_shot(tmp_path)
    for joints, told in (({"neck": "head"}, ["head and neck"]), ({"neck": "neck"}, [])):
        for notes in (read_shot(path, joints=joints).notes, spoils(path, joints=joints)):
            said = [note for note in notes if "at once" in note]
            assert said == [f"/Hero/Rig: joint 'head' is {each} at once; check --joint and --head" for each in told]


@pytest.mark.parametrize("uneven", [None, "character", "head", "arm_L"])
def test_hair_that_is_scaled_unevenly_is_told(tmp_path, uneven):
    """Because its strands then change their lengths in the world; an even scale is fine."""
    scale = np.diag([1.05, 0.95, 1.05, 1] if uneven == "character" else [0.6, 0.6, 0.6, 1])
    path = write_shot(tmp_path, Recipe(place=scale))
    if uneven in ("head", "arm_L"):
        stage = Usd.Stage.Open(str(path))
        animation = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion"))
        names = [name.rsplit("/", 1)[-1] for name in animation.GetJointsAttr().Get()]
        animation.GetScalesAttr().Set([Gf.Vec3h(1.2, 0.75, 1.2) if name == uneven else Gf.Vec3h(1) for name in names])
        stage.Save()
    words = {
        "character": "the transform of /Hero above it is scaled unevenly and stretches its hair, at time code 9 by 6% more",
        "head": "joint 'head' is scaled unevenly and stretches its hair, at time code 1 by 60% more",
    }.get(uneven)
    said = _said(path, "along one axis")
    assert len(said) == (words is not None) and all(words in note for note in said)


def test_hair_that_is_scaled_flat_is_told_without_millions_of_percent(tmp_path):
    (said,) = _said(write_shot(tmp_path, Recipe(place=np.diag([1e-5, 1, 1, 1]))), "along one axis")
    assert " over 10 times as much along one axis as along another: " in said and "%" not in said
