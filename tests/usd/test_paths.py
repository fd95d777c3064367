# SPDX-License-Identifier: Apache-2.0
"""Paths of files and prims as callers give them, and names that files or layers cannot have."""

import os

import pytest
from pxr import Sdf

from neuralocks_core.errors import NeuralocksError
from usd.assets.body import write_body
from usd.assets.grow import grow
from usd.assets.importing import import_groom
from usd.baking.bake import bake
from usd.models.export import export_model
from usd.review.demo import demo
from usd.review.inspect import inspect
from usd.shot.stage import read_shot

from .commands import status
from .shots import Recipe, write_shot

HAIR, RIG = "/Hero/Hair", "/Hero/Rig"


def test_a_name_too_long_for_a_file_is_told(tmp_path, capsys):
    """In one line, by the Python calls and by the command."""
    shot = write_shot(tmp_path, Recipe())
    for length in (244, 300):  # a bake makes a folder beside the file, whose name is longer
        out = tmp_path / f"{'a' * length}.usdc"
        with pytest.raises(NeuralocksError, match="choose a shorter one"):
            bake(shot, out, frames="1:2")
        assert status("bake", shot, "-o", out, "--frames", "1:2") == 1
        assert capsys.readouterr().err.rstrip().endswith("choose a shorter one")
    assert [path.name for path in tmp_path.iterdir()] == [shot.name]


def test_nothing_is_no_path(model):
    with pytest.raises(NeuralocksError, match="out: None is not a path"):
        bake("shot.usda", None, model)
    with pytest.raises(NeuralocksError, match="shot: None is not a path"):
        bake(None, "a.usdc", model)
    for work in (
        lambda: demo(None),
        lambda: grow("bob", "body.usdc", None),
        lambda: import_groom(None, "a.usdc"),
        lambda: inspect(None),
        lambda: write_body(None),
        lambda: export_model(model, None),
    ):
        with pytest.raises(NeuralocksError, match="None is not a path"):
            work()


@pytest.mark.parametrize("kind", [str, Sdf.Path, lambda path: f"{path}/"])
def test_a_lone_prim_path_of_any_kind_is_taken(tmp_path, kind):
    shot = read_shot(write_shot(tmp_path), kind(HAIR), kind(RIG))
    assert ([item.path for item in shot.grooms], [rig.path for rig in shot.rigs]) == ([HAIR], [RIG])


def test_names_that_usd_cannot_keep_are_told(tmp_path, model):
    shot = write_shot(tmp_path, name="line\nbreak")
    with pytest.raises(NeuralocksError, match="such as a line break.*rename it"):
        bake(shot, tmp_path / "a.usdc", model, frames="1")
    with pytest.raises(NeuralocksError, match="SDF_FORMAT_ARGS: as arguments; choose another name"):
        bake(shot, tmp_path / "a:SDF_FORMAT_ARGS:b=c.usdc", model, frames="1")
    assert [path.name for path in tmp_path.iterdir()] == [shot.name]


@pytest.mark.skipif(os.sep == "\\", reason="there it is a slash")
@pytest.mark.parametrize("name", ["a\\b/hair.usdc", "a\\b.usdc"])
def test_a_backslash_in_a_bakes_path_is_told(tmp_path, model, name):
    """USD turns it into a slash, and would open the bake without its shot."""
    out = tmp_path / name
    out.parent.mkdir(exist_ok=True)
    shot = write_shot(out.parent)
    with pytest.raises(NeuralocksError, match="the backslash in its path .* rename it"):
        bake(shot, out, model, frames="1:2")
    assert [path.name for path in out.parent.iterdir()] == [shot.name]


@pytest.mark.skipif(not os.path.exists("/dev/null"), reason="Windows has none")
def test_what_is_no_file_is_not_called_missing():
    with pytest.raises(NeuralocksError, match="/dev/null: is not a file"):
        inspect("/dev/null")
