# SPDX-License-Identifier: Apache-2.0
"""The report card of hair on bones: USD's own skinning and a body whose depths are known say the same."""

import json

import numpy as np
import pytest
import trimesh
from pxr import Sdf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from usd.review.inspect import inspect
from usd.rig.bake import bake_rig
from usd.rig.evaluate import RigCard, _Posed, evaluate_rig
from usd.rig.stage import read_rigged_hair

from ..commands import status
from ..fbx_rigs import FRAMES, write_character
from ..rig_shots import EXAMPLE, model_for, small_shot

CODES = range(1, 26)
"""Frames of a small shot."""


def hair_by_usd(stage, codes, mesh="/Who/Hair", rig="/Who/Rig", head=1, rest=None):
    """Vertices (T, V, 3) of a mesh, or of `rest` (V, 3) in its place, in the frame of its head joint, in the stage's units, by
    UsdSkel alone.
    """
    cache, skel_root = UsdSkel.Cache(), UsdSkel.Root(stage.GetPrimAtPath(Sdf.Path(rig).GetParentPath()))
    cache.Populate(skel_root, Usd.PrimDefaultPredicate)
    query = cache.GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath(rig)))
    skinning = cache.GetSkinningQuery(stage.GetPrimAtPath(mesh))
    found = []
    for code in codes:
        points = UsdGeom.Mesh(stage.GetPrimAtPath(mesh)).GetPointsAttr().Get(code)
        points = points if rest is None else Vt.Vec3fArray.FromNumpy(rest)
        joints = query.ComputeSkinningTransforms(code)
        skinning.ComputeSkinnedPoints(joints, points, code)
        place = np.array(query.ComputeJointSkelTransforms(code))[head]
        found.append((np.c_[np.array(points), np.ones(len(points))] @ np.linalg.inv(place))[:, :3])
    return np.stack(found)


@pytest.mark.parametrize(("scale", "z_up"), [(1.0, False), (100.0, True)])
def test_swing_is_what_usd_shows(tmp_path, scale, z_up):
    shot = small_shot(tmp_path / "shot.usda", scale=scale, z_up=z_up)
    baked = bake_rig(shot, tmp_path / "baked.usda", model_for(read_rigged_hair(shot))).path
    card = evaluate_rig(baked).measures
    moved, stiff = (hair_by_usd(Usd.Stage.Open(str(path)), CODES) for path in (baked, shot))
    off = np.linalg.norm(moved - stiff, axis=-1) / scale
    assert card["frames"] == 25 and card["vertices"] == 9 and card["joints"] == 3
    assert card["swing_mm"] == pytest.approx(1e3 * np.sqrt(np.square(off).mean()), rel=1e-3)
    assert card["swing_most"] == "hair_0" and "body" not in card


def test_depths_are_those_of_a_known_body(tmp_path, monkeypatch):
    """A wall 5 mm behind the tail's rest place: for each vertex it is known whether it goes in, and how deep."""
    shot = small_shot(tmp_path / "shot.usda")
    baked = bake_rig(shot, tmp_path / "baked.usda", model_for(read_rigged_hair(shot))).path
    stage = Usd.Stage.Open(str(baked))
    moved, head = hair_by_usd(stage, CODES), np.array([0, 1.5, 0])
    wall = hair_by_usd(Usd.Stage.Open(str(shot)), [0])[0][:, 2].min() - 0.005
    box = UsdGeom.Mesh.Define(stage, "/Who/Wall")
    corners = np.array([[x, y, z] for x in (-0.15, 0.15) for y in (-0.15, 0.15) for z in (wall - 0.1, wall)]) + head
    box.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(corners.astype(np.float32)))
    box.CreateFaceVertexCountsAttr([4] * 6)
    box.CreateFaceVertexIndicesAttr([0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3])
    binding = UsdSkel.BindingAPI.Apply(box.GetPrim())
    binding.CreateSkeletonRel().SetTargets(["/Who/Rig"])
    binding.CreateJointIndicesPrimvar(False, 1).Set([1] * 8)
    binding.CreateJointWeightsPrimvar(False, 1).Set([1.0] * 8)
    stage.GetRootLayer().Save()
    depth = np.maximum(wall - moved[..., 2], 0)
    assert depth.max() > 0.005, "the tail does not reach the wall"
    card = evaluate_rig(baked).measures
    monkeypatch.setattr("usd.rig.evaluate.FRAMES", 2)
    few = evaluate_rig(baked).measures
    assert few["body_frames"] == 2 and few["body"]["deepest_at"] not in (CODES[0], CODES[-1])
    for deepest in ("penetration_worst_mm", "deepest_at", "deepest"):
        assert few["body"][deepest] == card["body"][deepest], "the deepest frame counts, wherever it is"
    looked, measured, of = [], [], _Posed
    seemingly, distances = of.seemingly, of.distances
    monkeypatch.setattr(of, "seemingly", lambda posed, row, at: looked.append(row) or seemingly(posed, row, at))
    monkeypatch.setattr(of, "distances", lambda posed, row, at: measured.append(row) or distances(posed, row, at))
    monkeypatch.setattr("usd.rig.evaluate.LOOKED_AT", 4)
    monkeypatch.setattr("usd.rig.evaluate.DEEPEST_FRAMES", 1)
    said = []
    assert evaluate_rig(baked, progress=lambda *words: said.append(words)).measures["body_frames"] == 2
    assert looked == [7, 14, 21] and len(measured) == 3
    assert said[25:] == [(done + 1, 3, "measuring distances to the body") for done in range(3)]
    assert card["body_frames"] == 25
    assert card["body"]["penetration_worst_mm"] == pytest.approx(1e3 * depth.max(), abs=0.01)
    assert card["body"]["penetration_percent"] == pytest.approx(100 * (depth > 2e-6).mean(), abs=0.01)
    assert card["body"]["penetration_3mm_percent"] == pytest.approx(100 * (depth > 3e-3).mean(), abs=0.5)
    assert card["body"]["deepest_at"] == CODES[depth.max(axis=1).argmax()] and card["body"]["deepest"] == "hair_0"
    assert card["body_rigid"]["penetration_worst_mm"] == 0


def test_a_bake_keeps_hair_out_and_rests_and_the_command_says_so(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("usd.rig.evaluate.FRAMES", 4)
    monkeypatch.setattr("usd.rig.evaluate.DEEPEST_FRAMES", 2)
    monkeypatch.setattr("usd.rig.evaluate.VERTICES", 1000)
    baked = bake_rig(EXAMPLE / "shot.usda", tmp_path / "baked.usdc", EXAMPLE / "quasi_static.neuralocks").path
    assert status("rig", "evaluate", baked, "--json") == 0
    card = json.loads(capsys.readouterr().out)
    assert card["skeleton"] == "/Body/Rig" and card["frames"] == 193 and card["notes"] == []
    body, rigid = card["body"], card["body_rigid"]
    assert body["penetration_percent"] < 0.1 * rigid["penetration_percent"]
    assert body["penetration_worst_mm"] < 0.3 * rigid["penetration_worst_mm"]


def test_chains_and_depths_are_those_of_an_animated_rig(tmp_path, monkeypatch):
    """Five chains, some already in the head at rest, one of them deep; a blend shape swells the head by a centimetre."""
    path, codes = tmp_path / "shot.usda", range(1, FRAMES + 1)
    write_character(path, 24)
    stage = Usd.Stage.Open(str(path))
    body, hair = (UsdGeom.Mesh(stage.GetPrimAtPath(f"/Fbx/{name}")) for name in ("Body", "Hair"))
    skin, tips = (np.array(mesh.GetPointsAttr().Get()) for mesh in (body, hair))
    out, ball = np.zeros_like(skin), skin[: len(skin) // 2]
    out[: len(ball)] = (ball - ball.mean(axis=0)) / 9
    skin += 3 * out
    tips[-1] = ball.mean(axis=0) - (0, 0, 5)
    for mesh, points in ((body, skin), (hair, tips)):
        mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(points))
    aside = np.tile(np.float32([0.2, 0.1, -0.3]), (len(tips), 1))
    for mesh, offsets in ((body, out), (hair, aside)):
        shape = UsdSkel.BlendShape.Define(stage, mesh.GetPath().AppendChild("breath"))
        shape.CreateOffsetsAttr(Vt.Vec3fArray.FromNumpy(offsets))
        binding = UsdSkel.BindingAPI(mesh.GetPrim())
        binding.CreateBlendShapesAttr(["breath"])
        binding.CreateBlendShapeTargetsRel().SetTargets([shape.GetPath()])
    animation = UsdSkel.Animation(stage.GetPrimAtPath("/Fbx/Armature/Take"))
    animation.CreateBlendShapesAttr(["breath"])
    animation.CreateBlendShapeWeightsAttr([1.0])
    stage.Save()

    def by_usd(mesh, rest):
        return 0.01 * hair_by_usd(stage, codes, mesh.GetPath(), "/Fbx/Armature", 3, rest)

    joints = np.array(UsdSkel.BindingAPI(hair.GetPrim()).GetJointIndicesPrimvar().Get())
    names = list(UsdSkel.Skeleton(stage.GetPrimAtPath("/Fbx/Armature")).GetJointsAttr().Get())
    chain = np.array([names[joint].split("/")[4] for joint in joints])
    points = by_usd(hair, tips + aside)
    off = np.square(points - points[0]).sum(axis=-1)  # the first frame is the bind pose
    swing = {name: 1e3 * np.sqrt(off[:, chain == name].mean()) for name in chain}
    faces = np.reshape(body.GetFaceVertexIndicesAttr().Get(), (-1, 3))
    skins, vertices = [by_usd(body, skin)[0], *by_usd(body, skin + out)], [by_usd(hair, tips)[0], *points]
    meshes = [trimesh.Trimesh(each, faces, process=False) for each in skins]
    distance = [-trimesh.proximity.signed_distance(mesh, each) for mesh, each in zip(meshes, vertices)]
    depth = np.maximum(np.minimum(distance[0], 0) - distance[1:], 0)
    deepest = np.unravel_index(depth.argmax(), depth.shape)
    assert deepest[1] != np.argmin(distance[0]) and depth.max() > 0.005

    card = evaluate_rig(path)
    assert [f"('{chain[deepest[1]]}' at" in line for line in card.lines()[-2:]] == [True, False]
    card = card.measures
    assert (card["joints"], card["chains"], card["vertices"]) == (18, 5, len(chain))
    assert card["swing_mm"] == pytest.approx(1e3 * np.sqrt(off.mean()), rel=1e-3)
    assert card["swing_most"] == max(swing, key=swing.__getitem__)
    assert card["swing_most_mm"] == pytest.approx(max(swing.values()), rel=1e-3)
    assert card["body"]["inside_at_rest_percent"] == pytest.approx(100 * (distance[0] < 0).mean())
    assert card["body"]["penetration_percent"] == pytest.approx(100 * (depth > 2e-6).mean(), abs=0.1)
    assert card["body"]["penetration_worst_mm"] == pytest.approx(1e3 * depth.max(), abs=0.05)
    assert card["body"]["deepest_at"] == codes[deepest[0]] and card["body"]["deepest"] == chain[deepest[1]]
    monkeypatch.setattr("usd.rig.evaluate.FRAMES", 2)
    monkeypatch.setattr("usd.rig.evaluate.DEEPEST_FRAMES", 1)
    assert evaluate_rig(path).measures["body"]["deepest_at"] == card["body"]["deepest_at"], "it is where it seems to be"
    monkeypatch.setattr("usd.rig.evaluate.FRAMES", 7)
    seldom = evaluate_rig(path).measures
    assert seldom["body_frames"] == 7 and seldom["frames"] == FRAMES
    spread = depth[np.linspace(0, FRAMES - 1, 7).round().astype(int)]
    assert seldom["body"]["penetration_percent"] == pytest.approx(100 * (spread > 2e-6).mean(), abs=0.1)
    at = depth[codes.index(seldom["body"]["deepest_at"])]
    assert seldom["body"]["penetration_worst_mm"] == pytest.approx(1e3 * at.max(), abs=0.05)
    monkeypatch.setattr("usd.rig.evaluate.VERTICES", len(chain) // 3)
    few = evaluate_rig(path).measures
    assert few["vertices"] == len(chain) // 3 and few["swing_most"] == card["swing_most"]
    assert few["swing_most_mm"] == pytest.approx(card["swing_most_mm"], rel=0.1)


def test_hair_that_does_not_move_is_told(tmp_path, capsys):
    assert status("rig", "evaluate", small_shot(tmp_path / "shot.usda")) == 0
    said, notes = capsys.readouterr()
    assert said.startswith("/Who/Rig: 3 hair joints in 1 chain\nmeasured: 9 vertices in 25 frames\n")
    assert "swing: none, as if hair were carried rigidly\n" in said and "inside the body: not measured" in said
    assert notes.startswith("note: /Who/Rig: no joint found for neck;")


def test_a_card_says_in_words_what_was_measured():
    """And no number where there is none: less than rounding, no pose that is held, no body."""
    swing = {"vertices": 9, "frames": 25, "swing_mm": 1.26, "swing_most": "hair_0", "swing_most_mm": 0.06}
    deep = {"penetration_percent": 1.5, "penetration_3mm_percent": 0.25, "penetration_worst_mm": 4.06}
    bodies = {
        "body_frames": 7,
        "body": deep | {"deepest": "hair_0", "deepest_at": 7.5},
        "body_rigid": {**dict.fromkeys(deep, 0.01), "deepest": "hair_0", "deepest_at": 1.0},
    }
    lines = RigCard(EXAMPLE, "/Who/Rig", swing | {"jitter_mm": 0.1234} | bodies, []).lines()
    assert lines == [
        "measured: 9 vertices in 25 frames",
        "swing: 1.3 mm from hair carried rigidly, most of 'hair_0', 0.1 mm",
        "held pose: jitter 0.123 mm",
        "inside the body: 1.50 % of vertices, deeper than 3 mm 0.25 %, at most 4.1 mm ('hair_0' at 7.5), in 7 frames",
        "inside the body, carried rigidly: 0.01 % of vertices, deeper than 3 mm 0.01 %, at most 0.0 mm, in 7 frames",
    ]
    rigid = RigCard(EXAMPLE, "/Who/Rig", swing | {"swing_most_mm": 0.01, "jitter_mm": np.nan}, []).lines()
    assert rigid[1:] == [
        "swing: none, as if hair were carried rigidly",
        "inside the body: not measured, no body of this skeleton is near the hair",
    ]


def test_of_several_characters_the_baked_one_is_measured_and_others_are_told(tmp_path):
    small_shot(tmp_path / "shot.usda")
    stage = Usd.Stage.CreateNew(str(tmp_path / "both.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    for name in ("One", "Two"):
        stage.DefinePrim(f"/{name}").GetReferences().AddReference("./shot.usda")
    stage.Save()

    def measured(path, **options):
        card = evaluate_rig(path, **options)
        return card.skeleton, [note for note in card.notes if "not measured" in note]

    both = tmp_path / "both.usda"
    model = model_for(read_rigged_hair(tmp_path / "shot.usda"))
    baked = bake_rig(both, tmp_path / "baked.usda", model, skeleton="/Two/Rig").path
    told = "Rig: its hair is not measured; name it with --skeleton"
    assert measured(both) == ("/One/Rig", [f"/Two/{told}"])
    assert measured(baked) == ("/Two/Rig", [f"/One/{told}"])
    assert measured(baked, skeleton="/One/Rig") == ("/One/Rig", [])


@pytest.mark.parametrize(("code", "told"), [(52, False), (53, True)])
def test_a_held_pose_rests(tmp_path, code, told):
    """The head stands still from frame 5 to 96: quasi-static hair does, too, and trembling two seconds later is reported."""
    shot = small_shot(tmp_path / "shot.usda", frames=96)
    stage = Usd.Stage.Open(str(shot))
    turns = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion")).GetRotationsAttr()
    for later in range(6, 97):
        turns.Set(turns.Get(5), later)  # in the last frame it moves again
    stage.GetRootLayer().Save()
    baked = bake_rig(shot, tmp_path / "baked.usda", model_for(read_rigged_hair(shot))).path
    assert evaluate_rig(baked).measures["jitter_mm"] == 0
    stage = Usd.Stage.Open(str(baked))
    turns = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Rig/NeuralocksHair")).GetRotationsAttr()
    rotations = turns.Get(code)
    rotations[2] = type(rotations[2])(np.cos(0.005), np.sin(0.005), 0, 0) * rotations[2]
    turns.Set(rotations, code)
    stage.GetRootLayer().Save()
    # A hundredth of a radian about the first joint, from which the farthest vertex is 0.15 m away.
    jitter = evaluate_rig(baked).measures["jitter_mm"]
    assert 0.5 < jitter < 1.6 if told else jitter == 0


def test_what_cannot_be_measured_is_one_line(tmp_path):
    with pytest.raises(NeuralocksError, match="/Body/Rig: is not animated; give a bake, or an animated character"):
        evaluate_rig(EXAMPLE / "character.usda")
    shot = small_shot(tmp_path / "shot.usda")
    with pytest.raises(NeuralocksError, match="--chains tail.*: no joint of the hair has such a name"):
        evaluate_rig(shot, chains=["hair_0", "tail*"])
    stage = Usd.Stage.Open(str(shot))
    stage.RemovePrim("/Who/Hair")
    stage.GetRootLayer().Save()
    with pytest.raises(
        NeuralocksError, match="/Who/Rig: no mesh that is shown is skinned to its hair joints; there is nothing"
    ):
        evaluate_rig(shot)


def test_the_hair_of_a_bake_is_what_it_moves(tmp_path, monkeypatch):
    """Without naming its chains again; also in pictures and in what is inspected."""
    monkeypatch.setattr("usd.rig.evaluate.FRAMES", 2)
    monkeypatch.setattr("usd.rig.evaluate.DEEPEST_FRAMES", 2)
    monkeypatch.setattr("usd.rig.evaluate.VERTICES", 500)
    some, shot = ["hair_back*_1", "hair_nape*_1"], tmp_path / "short.usda"
    whole = Usd.Stage.Open(str(EXAMPLE / "shot.usda")).Flatten()
    stage = Usd.Stage.Open(whole)
    moves = [each for prim in stage.Traverse() if prim.IsA(UsdSkel.Animation) for each in prim.GetAttributes()]
    for path, code in [(each.GetPath(), code) for each in moves for code in each.GetTimeSamples() if code > 24]:
        whole.EraseTimeSample(path, code)
    whole.endTimeCode = 24
    whole.Export(str(shot))
    model = model_for(read_rigged_hair(shot, chains=some))
    baked = bake_rig(shot, tmp_path / "baked.usda", model).path
    card = evaluate_rig(baked)
    assert str(card.measures) == str(evaluate_rig(baked, chains=some).measures)  # some are NaN
    assert card.measures["joints"] == len(model.chains) < evaluate_rig(baked, chains=["hair_*_1"]).measures["joints"]
    names = {name for name in model.chains.names if name.endswith("_1")}
    (skeleton,) = inspect(baked)["skeletons"]
    assert {row["name"] for row in skeleton["hair chains"]} == names
    assert set(read_rigged_hair(baked, baked_first=True).rig.chains.names) == set(model.chains.names)
