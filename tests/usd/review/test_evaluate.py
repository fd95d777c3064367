# SPDX-License-Identifier: Apache-2.0
"""The report card of bakes whose answers are known."""

import json

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, Vt

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import Material
from usd.baking.bake import bake
from usd.cli.app import main
from usd.review.baked import read_baked
from usd.review.demo import shipped_shot
from usd.review.evaluate import evaluate
from usd.review.inspect import inspect
from usd.shot.bakes.bake_record import record, recorded

from ..shots import Recipe, write_shot

FRAMES = "1:60:12"


@pytest.fixture(scope="module")
def rigid(tmp_path_factory, still_model):
    out = tmp_path_factory.mktemp("bakes") / "rigid.usdc"
    bake(shipped_shot(), out, still_model, frames=FRAMES, velocities=False, resolve=False)
    return out


def test_a_rigid_bake_has_no_motion_no_droop_and_exact_lengths(rigid):
    values = next(iter(evaluate(rigid).grooms.values()))
    assert values["frames"] == 5
    for name in ("droop_cm", "speed_cm_s", "swing_percent", "energy_bend", "energy_gravity"):
        assert values[name] == pytest.approx(0, abs=1e-3), name
    assert values["stretch_percent_max"] < 0.01


def test_droop_is_how_far_tips_hang_below_the_rigid_hair_whichever_way_the_head_is_up(tmp_path, still_model):
    lying = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    recipe, out = Recipe(place=lying, strands=6), tmp_path / "hair.usda"
    bake(write_shot(tmp_path, recipe), out, still_model, frames="1:3", velocities=False, resolve=False)
    stage, layer = Usd.Stage.Open(str(out)), Sdf.Layer.FindOrOpen(str(out))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    below = np.tile(np.linspace(0, 0.02, recipe.vertices), recipe.strands)[:, None] * [0, -1.0, 0]
    for code in curves.GetPointsAttr().GetTimeSamples():
        to_world = np.array(UsdGeom.XformCache(code).GetLocalToWorldTransform(curves.GetPrim()))
        moved = np.array(curves.GetPointsAttr().Get(code)) + below @ to_world[:3, :3].T
        layer.SetTimeSample(curves.GetPointsAttr().GetPath(), code, Vt.Vec3fArray.FromNumpy(moved.astype(np.float32)))
    layer.Save()
    assert evaluate(out).grooms["/Hero/Hair"]["droop_cm"] == pytest.approx(2, abs=0.01)


def test_a_moving_bake_moves_and_keeps_its_lengths(tmp_path, model):
    bake(shipped_shot(), tmp_path / "moving.usdc", model, frames=FRAMES, velocities=False)
    values = next(iter(evaluate(tmp_path / "moving.usdc").grooms.values()))
    assert values["speed_cm_s"] > 0.02 and values["swing_percent"] > 0.02
    assert values["energy_bend"] > 0
    # Hair of exact length stores no stretch energy, however much finer than the network's vertices it winds.
    assert values["stretch_percent_max"] < 0.01 and values["energy_stretch"] < 1e-5


def test_resolving_takes_hair_out_of_the_body(tmp_path, model):
    share = {}
    for resolve in (False, True):
        out = tmp_path / f"resolved-{resolve}.usdc"
        bake(shipped_shot(), out, model, frames="20:60:20", resolve=resolve, velocities=False)
        share[resolve] = next(iter(evaluate(out).grooms.values()))["penetration_percent"]
    assert share[False] > 1
    assert share[True] < 0.1 * share[False]


def test_the_command_draws_the_curves_of_the_card(rigid, tmp_path, capsys):
    pytest.importorskip("matplotlib", reason="the extra 'compare' is not installed")
    with pytest.raises(SystemExit) as ended:
        main(["evaluate", str(rigid), "--json", "--groom", "/Body", "--plot", str(tmp_path / "tips.png")])
    assert ended.value.code == 0 and json.loads(capsys.readouterr().out)["grooms"]
    assert (tmp_path / "tips.png").read_bytes().startswith(b"\x89PNG")


def test_of_a_groom_without_hair_nothing_is_claimed(tmp_path, model):
    shot = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(shot))
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
    roots = np.array(points.Get()).reshape(40, 12, 3)[:, :1]
    points.Set(Vt.Vec3fArray.FromNumpy(np.repeat(roots, 12, axis=1).reshape(-1, 3)))
    stage.Save()
    bake(shot, tmp_path / "hair.usdc", model)
    card = evaluate(tmp_path / "hair.usdc", reference=True)
    assert card.grooms["/Hero/Hair"] == {"strands": 40, "measured": 0, "frames": 9}
    assert any("nothing is measured" in note for note in card.notes)


def test_words_and_dicts_name_a_material_as_they_do_for_a_bake(tmp_path, model):
    bake(write_shot(tmp_path), tmp_path / "hair.usdc", model)
    bends = [
        next(iter(evaluate(tmp_path / "hair.usdc", material=look).grooms.values()))["energy_bend"]
        for look in (None, Material(bend=2e-3), "stiffness=2x", ["bend=2x"], {"stiffness": "2x"})
    ]
    assert bends[1:] == pytest.approx([2 * bends[0]] * 4)


def test_a_model_is_shown_beside_the_reference_only(rigid):
    with pytest.raises(NeuralocksError, match="add --reference"):
        evaluate(rigid, model="nonexistent.neuralocks")


def test_a_stage_without_samples_is_no_bake():
    with pytest.raises(NeuralocksError, match="no animated points"):
        read_baked(shipped_shot())


def test_only_what_was_baked_is_measured(tmp_path, model):
    """A beard that the same skeleton still skins: its points are at rest, and not a bake."""
    stage = Usd.Stage.Open(str(write_shot(tmp_path)))
    Sdf.CopySpec(stage.GetRootLayer(), "/Hero/Hair", stage.GetRootLayer(), "/Hero/Beard")
    stage.GetRootLayer().Save()
    bake(stage.GetRootLayer().realPath, tmp_path / "hair.usdc", model, grooms=["/Hero/Hair"])
    card = evaluate(tmp_path / "hair.usdc")
    assert list(card.grooms) == ["/Hero/Hair"]
    assert any("/Hero/Beard" in note for note in card.notes)


def test_frames_that_a_bake_lacks_are_named(tmp_path, still_model):
    """Between others; a bake of every fourth frame, or of the shot's middle, lacks none."""
    shot = write_shot(tmp_path, Recipe(frames=60))
    bake(shot, tmp_path / "part.usdc", still_model, frames="20:48:4", velocities=False, resolve=False)
    assert not any("no samples" in note for note in evaluate(tmp_path / "part.usdc").notes)
    stage = Usd.Stage.Open(str(tmp_path / "part.usdc"))
    (groom,) = (path for path in evaluate(tmp_path / "part.usdc").grooms)
    for code in (32, 36):
        UsdGeom.BasisCurves(stage.GetPrimAtPath(groom)).GetPointsAttr().ClearAtTime(code)
    stage.Save()
    assert [note for note in evaluate(tmp_path / "part.usdc").notes if "no samples" in note] == [
        f"{groom}: has no samples between 28 and 40, where hair moves along straight lines; bake these frames, too"
    ]


def test_each_groom_is_measured_at_its_own_samples(tmp_path, model):
    """Between its samples a groom is drawn along chords, and after them it stands still on a character that moves on."""
    stage = Usd.Stage.Open(str(write_shot(tmp_path)))
    Sdf.CopySpec(stage.GetRootLayer(), "/Hero/Hair", stage.GetRootLayer(), "/Hero/Beard")
    stage.GetRootLayer().Save()
    bake(stage.GetRootLayer().realPath, tmp_path / "hair.usdc", model, subframes=2)
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "hair.usdc"))
    for code in layer.ListTimeSamplesForPath("/Hero/Beard.points"):
        if code % 1 or code > 6:
            layer.EraseTimeSample("/Hero/Beard.points", code)
    layer.Save()
    card, alone = evaluate(tmp_path / "hair.usdc"), evaluate(tmp_path / "hair.usdc", grooms=["/Hero/Beard"])
    assert card.grooms["/Hero/Hair"]["frames"] > card.grooms["/Hero/Beard"]["frames"] == 6
    assert card.grooms["/Hero/Beard"] == pytest.approx(alone.grooms["/Hero/Beard"], nan_ok=True)
    assert card.grooms["/Hero/Beard"]["stretch_percent_max"] < 0.01


def test_of_several_grooms_progress_says_which_is_measured(tmp_path, model):
    """Share and time left begin anew with each, and with what is measured of both together."""
    stage = Usd.Stage.Open(str(write_shot(tmp_path)))
    Sdf.CopySpec(stage.GetRootLayer(), "/Hero/Hair", stage.GetRootLayer(), "/Hero/Brows")
    stage.GetRootLayer().Save()
    bake(tmp_path / "shot.usda", tmp_path / "both.usda", model, frames="1:3")
    said = []
    evaluate(tmp_path / "both.usda", progress=lambda done, total, message: said.append(message))
    assert {message.partition(":")[0] for message in said} == {"groom 1 of 2", "groom 2 of 2", "grooms 1 to 2 of 2"}
    said.clear()
    evaluate(tmp_path / "both.usda", grooms=["/Hero/Brows"], progress=lambda done, total, message: said.append(message))
    assert said and not any("groom" in message for message in said)


def test_the_material_of_a_bake_is_known_from_the_bake(tmp_path, model):
    """Also through a layer on top; a given material wins, and an invalid one is reported."""
    shot, out, above = write_shot(tmp_path), tmp_path / "hair.usdc", tmp_path / "above.usda"
    soft = Material(bend=4e-4, weight=1.5)
    bake(shot, out, model, material=soft, strength=0.5)
    layer = Sdf.Layer.CreateNew(str(above))
    layer.subLayerPaths.append("hair.usdc")
    layer.Save()
    told, given, other = (evaluate(above, material=material).to_json() for material in (None, soft, Material()))
    assert told == given != other
    with_it = next(groom["baked with"] for groom in inspect(above)["grooms"])
    assert with_it["material"]["bend"] == 4e-4 and with_it["strength"] == 0.5
    stage = Usd.Stage.Open(str(above))
    prim = stage.OverridePrim("/Hero/Hair")
    for wrong in ({"bend": 1.0}, {"bend": "stiff"}, {"colour": 1.0}, "soft"):
        prim.SetCustomDataByKey("neuralocks:material", wrong)
        stage.Save()
        with pytest.raises(NeuralocksError, match="/Hero/Hair: customData 'neuralocks' has no material .*--material"):
            evaluate(above)
        assert evaluate(above, material=soft).to_json() == given
        prim.ClearCustomDataByKey("neuralocks:material")


def test_a_bake_over_a_bake_tells_of_itself_alone(tmp_path, model):
    """USD composes dictionaries of all layers into one: the lower bake's options would show through."""
    bake(write_shot(tmp_path), tmp_path / "hair.usdc", model, material=Material(bend=4e-4))
    below = Sdf.Layer.FindOrOpen(str(tmp_path / "hair.usdc"))
    record(below.GetPrimAtPath("/Hero/Hair"), {"solver": "rods"})
    below.Save()
    bake(tmp_path / "hair.usdc", tmp_path / "over.usdc", model)
    stage = Usd.Stage.Open(str(tmp_path / "over.usdc"))
    told = recorded(stage.GetPrimAtPath("/Hero/Hair"))
    assert "solver" not in told and told["material"]["bend"] == Material().bend


def test_a_model_without_a_reference_is_refused(rigid, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["evaluate", str(rigid), "--model", "strands.neuralocks"])
    assert ended.value.code == 1 and "--reference" in capsys.readouterr().err


def test_a_model_that_cannot_be_read_is_refused_before_anything_is_measured(rigid, tmp_path):
    told = []
    with pytest.raises(NeuralocksError, match="nope.neuralocks: no such model file"):
        evaluate(rigid, reference=True, model=tmp_path / "nope.neuralocks", progress=lambda *said: told.append(said))
    assert not told


def test_of_very_many_vertices_distances_are_measured_of_some(tmp_path, still_model, monkeypatch):
    baked, shares = bake(write_shot(tmp_path), tmp_path / "a.usdc", still_model, frames="1").path, []
    for most in (100_000, 120):
        monkeypatch.setattr("usd.review.subject.COLLISION_VERTICES", most)
        shares.append(next(iter(evaluate(baked).grooms.values()))["inside_at_rest_percent"])
    assert shares[0] > 5 and shares[1] == pytest.approx(shares[0], abs=4) and shares[1] != shares[0]
