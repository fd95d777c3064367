# SPDX-License-Identifier: Apache-2.0
"""A bake over another groom or animation than it was made from is told, and no other."""

import pytest
from pxr import Gf, Sdf, Usd

from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.baking.join import join
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
    with pytest.raises(NeuralocksError, match=f"part2.usdc: /Hero/Hair was baked from another {name} than in .*part1"):
        join(parts, tmp_path / "hair.usdc")
    assert not (tmp_path / "hair.usdc").exists()
    assert not any("bake again" in note for note in bake(parts[0], tmp_path / "over.usdc", model).notes)
    assert not any("bake again" in note for note in inspect(tmp_path / "over.usdc")["spoils"])


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
