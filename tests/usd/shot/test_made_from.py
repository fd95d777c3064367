# SPDX-License-Identifier: Apache-2.0
"""A bake over another groom or animation than it was made from gets a note, and no other bake does."""

import pytest
from pxr import Gf, Sdf, Usd, UsdSkel

from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.baking.join import join
from usd.review.demo import shipped_shot
from usd.review.evaluate import evaluate
from usd.review.inspect import inspect

from ..shots import Recipe, write_shot

OLD = "/Hero/Hair: the shot's {} is not the one that this was baked from; bake again"


def republish(shot, prim, attribute, change):
    """Change the first value of an attribute in place, in all its samples."""
    layer = Sdf.Layer.FindOrOpen(str(shot))
    path = Sdf.Path(prim).AppendProperty(attribute)
    for code in layer.ListTimeSamplesForPath(path):
        values = layer.QueryTimeSample(path, code)
        values[0] = change(values[0])
        layer.SetTimeSample(path, code, values)
    if not layer.ListTimeSamplesForPath(path):
        values = layer.GetAttributeAtPath(path).default
        values[0] = change(values[0])
        layer.GetAttributeAtPath(path).default = values
    layer.Save()


def turned(quaternion):
    return quaternion * Gf.Quatf(0.96, 0, 0.28, 0)


def moved(point):
    return point + Gf.Vec3f(0, 0.02, 0)


@pytest.mark.parametrize(
    ("name", "prim", "attribute", "change"),
    [("animation", "/Hero/Rig/Motion", "rotations", turned), ("groom", "/Hero/Hair", "points", moved)],
)
def test_what_was_published_anew_is_told(tmp_path, model, name, prim, attribute, change):
    shot, parts = write_shot(tmp_path), [tmp_path / "part1.usdc", tmp_path / "part2.usdc"]
    bake(shot, parts[0], model, frames="1:4")
    assert not any("bake again" in note for note in inspect(parts[0])["spoils"] + list(evaluate(parts[0]).notes))
    republish(shot, prim, attribute, change)
    assert OLD.format(name) in inspect(parts[0])["spoils"] and OLD.format(name) in evaluate(parts[0]).notes
    notes = bake(shot, parts[1], model, frames="5:9").notes
    assert OLD.format(name) not in notes
    with pytest.raises(
        NeuralocksError, match=f"part2.usdc: /Hero/Hair was baked from a different {name} than in .*part1"
    ):
        join(parts, tmp_path / "hair.usdc")
    assert not (tmp_path / "hair.usdc").exists()
    assert not any("bake again" in note for note in bake(parts[0], tmp_path / "over.usdc", model).notes)
    assert not any("bake again" in note for note in inspect(tmp_path / "over.usdc")["spoils"])


def test_one_key_that_differs_by_little_makes_another_animation(tmp_path, model):
    shot, out = write_shot(tmp_path), tmp_path / "hair.usdc"
    bake(shot, out, model, frames="1:2")
    stage = Usd.Stage.Open(str(shot))
    rotations = stage.GetAttributeAtPath("/Hero/Rig/Motion.rotations")
    values = rotations.Get(5)
    values[3] = values[3] * Gf.Quatf(1, 0, 1e-4, 0)
    rotations.Set(values, 5)
    stage.Save()
    assert OLD.format("animation") in inspect(out)["spoils"]


@pytest.mark.parametrize("weights", [[], [0.5, 0.5], [float("nan")]])
def test_weights_of_shapes_that_no_mesh_has_may_be_anything(tmp_path, model, weights):
    shot, out = write_shot(tmp_path), tmp_path / "hair.usdc"
    stage = Usd.Stage.Open(str(shot))
    motion = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion"))
    motion.CreateBlendShapesAttr(["smile"])
    motion.CreateBlendShapeWeightsAttr().Set(weights, 3)
    stage.Save()
    assert not inspect(shot)["stops"]
    bake(shot, out, model, frames="1:2")
    assert not any("bake again" in note for note in inspect(out)["spoils"])
    republish(shot, "/Hero/Rig/Motion", "rotations", turned)
    assert OLD.format("animation") in inspect(out)["spoils"]


def test_a_weight_that_may_be_anything_hides_no_change_of_others(tmp_path, model):
    shot, out = write_shot(tmp_path), tmp_path / "hair.usdc"
    stage = Usd.Stage.Open(str(shot))
    motion = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion"))
    motion.CreateBlendShapesAttr(["smile", "unused"])
    weights = motion.CreateBlendShapeWeightsAttr()
    weights.Set([0.5, float("nan")], 3)
    stage.Save()
    bake(shot, out, model, frames="1:2")
    assert not any("bake again" in note for note in inspect(out)["spoils"])
    weights.Set([0.75, float("nan")], 3)
    stage.Save()
    assert OLD.format("animation") in inspect(out)["spoils"]


@pytest.mark.parametrize("recipe", [Recipe(unit=0.01, up="Z"), Recipe(bound="mesh"), Recipe(bound="none", frames=3)])
def test_a_set_that_shows_a_bake_elsewhere_is_no_other_shot(tmp_path, model, recipe):
    """Placed, turned, seen through a reference or flattened, shifted in time, or counted in another unit."""
    bake(write_shot(tmp_path, recipe), tmp_path / "hair.usdc", model, frames="2:3")
    head = f'#usda 1.0\n(\n  metersPerUnit = {recipe.unit}\n  upAxis = "{recipe.up}"\n)\n'
    place = "double3 xformOp:translate = (3, 0, 500)\n  double xformOp:rotateY = 90\n"
    place += '  uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]\n'
    for name, how in (("set", ""), ("late", " (offset = 100)")):
        text = (
            head + f'def Xform "Set"\n{{\n  {place}  def "Who" (references = @hair.usdc@</Hero>{how})\n  {{\n  }}\n}}\n'
        )
        (tmp_path / f"{name}.usda").write_text(text)
    (tmp_path / "foreign.usda").write_text("#usda 1.0\n(\n  subLayers = [@hair.usdc@]\n)\n")
    Usd.Stage.Open(str(tmp_path / "set.usda")).Flatten().Export(str(tmp_path / "flat.usdc"))
    for name in ("hair.usdc", "set.usda", "late.usda", "foreign.usda", "flat.usdc"):
        assert not any("baked from" in note for note in inspect(tmp_path / name)["spoils"]), name


def test_a_moving_cache_whose_bake_gives_it_points_at_rest_is_known_again(tmp_path, model):
    shot = write_shot(tmp_path, Recipe(bound="none"))
    stage = Usd.Stage.Open(str(shot))
    points = stage.GetPrimAtPath("/Hero/Hair").GetAttribute("points")
    values = points.Get()
    points.Clear()
    for code in (1, 5, 9):
        points.Set(values, code)
    stage.GetRootLayer().Save()
    bake(shot, tmp_path / "hair.usdc", model)
    assert not any("baked from" in note for note in inspect(tmp_path / "hair.usdc")["spoils"])


def over(folder, name, below, how="", more=""):
    """A layer over another one."""
    path = folder / f"{name}.usda"
    path.write_text(f"#usda 1.0\n(\n  metersPerUnit = 1\n  subLayers = [@./{below}@{how}]\n)\n{more}")
    return path


def test_a_bake_that_is_played_slower_is_told_so_and_another_frame_rate_is_not(tmp_path, model):
    bake(write_shot(tmp_path), tmp_path / "hair.usdc", model)
    slow = over(tmp_path, "slow", "hair.usdc", " (scale = 2)")
    for notes in (inspect(slow)["spoils"], evaluate(slow).notes):
        assert any("/Hero/Hair: its bake is stretched to 2 times its length" in note for note in notes)
    fast = over(tmp_path, "fast", "hair.usdc")
    fast.write_text(fast.read_text().replace("(\n", "(\n  timeCodesPerSecond = 48\n", 1))
    for path in (fast, over(tmp_path, "late", "hair.usdc", " (offset = 10)")):
        assert not any("stretched" in note for note in inspect(path)["spoils"])


def test_a_bake_under_another_groom_is_told(tmp_path, model):
    """A groom with fewer strands in a layer below; and points in a layer above, which hide its samples."""
    shot = write_shot(tmp_path)
    bake(shot, tmp_path / "hair.usdc", model)
    stage = Usd.Stage.Open(str(shot))
    points = stage.GetPrimAtPath("/Hero/Hair").GetAttribute("points").Get()
    told = f'over "Hero"\n{{\n  over "Hair"\n  {{\n    point3f[] points = {[tuple(p) for p in points]}\n  }}\n}}\n'
    notes = inspect(over(tmp_path, "hides", "hair.usdc", more=told))["spoils"]
    assert "/Hero/Hair: its samples are hidden by a stronger layer; bake again" in notes
    told = 'over "Hero"\n{\n  over "Hair"\n  {\n    float velocities = 1\n  }\n}\n'
    notes = inspect(over(tmp_path, "odd", "hair.usdc", more=told))["spoils"]
    assert "/Hero/Hair: its velocities are float, not vector3f[]; export it again with that type" in notes
    unfit = "/Hero/Hair: 480 points at time code 5 for curves of 360 points; bake again"
    assert unfit not in inspect(tmp_path / "hair.usdc")["spoils"]
    hair = stage.GetPrimAtPath("/Hero/Hair")
    hair.GetAttribute("points").Set(points[:360])
    hair.GetAttribute("curveVertexCounts").Set([12] * 30)
    stage.GetRootLayer().Save()
    assert unfit in inspect(tmp_path / "hair.usdc")["spoils"]


def test_unsaved_changes_are_told_and_not_gone_on_without(tmp_path, model):
    shot, out = write_shot(tmp_path), tmp_path / "hair.usdc"

    def stop(done, total, message):
        if done >= 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bake(shot, out, model, progress=stop)
    layer = Sdf.Layer.FindOrOpen(str(shot))
    body = layer.GetPrimAtPath("/Hero/Rig")
    body.SetInfo("comment", "edited")
    assert layer.dirty
    result = bake(shot, out, model)
    assert not result.resumed and "shot.usda: has unsaved changes, which this bake has in it; save it" in result.notes
    layer.Save()
    assert not any("unsaved" in note for note in bake(shot, out, model).notes)


def test_parts_that_do_not_find_their_shot_are_not_joined(tmp_path, model):
    (tmp_path / "node").mkdir()
    part = bake(write_shot(tmp_path), tmp_path / "node" / "part.usdc", model, frames="1:4").path
    (tmp_path / "far" / "away").mkdir(parents=True)
    gone = part.rename(tmp_path / "far" / "away" / "part.usdc")
    with pytest.raises(NeuralocksError, match="part.usdc: does not find its shot .* join where it was baked"):
        join([gone], tmp_path / "hair.usdc")
    assert not (tmp_path / "hair.usdc").exists()


def test_a_bake_with_joints_by_hand_is_not_compared_without_them(tmp_path, still_model):
    """With left and right exchanged, a groom looks another way from the head."""
    swapped = {"left_upper_arm": "upperarm_r", "right_upper_arm": "upperarm_l"}
    out = tmp_path / "hair.usdc"
    bake(shipped_shot(), out, still_model, frames="60:61", joints=swapped, velocities=False, resolve=False)
    for joints in (None, swapped):
        assert not any("bake again" in note for note in inspect(out, joints=joints)["spoils"]), joints
