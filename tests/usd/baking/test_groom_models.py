# SPDX-License-Identifier: Apache-2.0
"""Each groom of a shot is moved by the shipped model that suits it."""

import numpy as np
import pytest
from pxr import Sdf, Usd

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models import model_file
from neuralocks_core.models.runtime import StrandModel
from usd.baking import groom_models
from usd.baking.bake import bake
from usd.border.stage_files import open_stage
from usd.models.export import export_model
from usd.shot.bakes.bake_record import recorded
from usd.shot.stage import read_shot

from ..shots import HAIR, samples, write_shot

OTHER = "/Hero/Other"


@pytest.fixture
def shot(tmp_path):
    """Two equal grooms on one head."""
    path = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    Sdf.CopySpec(stage.GetRootLayer(), HAIR, stage.GetRootLayer(), OTHER)
    stage.Save()
    return path


@pytest.fixture
def suits(monkeypatch, model, still_model):
    """As if a shipped model that never moves hair suited the one groom, and a lively one the other."""

    def suited(path, character, groom):
        if path is not None:
            return path
        return still_model if groom.name == HAIR else model

    monkeypatch.setattr(groom_models, "suited", suited)


def test_each_groom_moves_by_its_own(shot, tmp_path, suits, model, still_model):
    both = bake(shot, tmp_path / "both.usdc").path
    for prim, own in ((HAIR, still_model), (OTHER, model)):
        alone = bake(shot, tmp_path / "alone.usdc", own, grooms=[prim]).path
        for code in (1.0, 5.0):
            np.testing.assert_array_equal(
                samples(both, "points", at=code, prim=prim), samples(alone, "points", at=code, prim=prim)
            )
    stage = open_stage(both)
    told = [recorded(stage.GetPrimAtPath(prim))["model"] for prim in (HAIR, OTHER)]
    assert told[0] != told[1]


def test_a_part_of_the_grooms_moves_as_all_do(shot, tmp_path, suits):
    both, part = (bake(shot, tmp_path / f"{n}.usdc", grooms=n and [OTHER]).path for n in (0, 1))
    np.testing.assert_array_equal(*(samples(path, "points", at=5.0, prim=OTHER) for path in (both, part)))


def test_the_shipped_model_moves_all_where_it_is_named(shot, suits):
    (used,) = groom_models.GroomModels(str(model_file.shipped())).each(read_shot(shot).grooms)
    assert used[0].file.path == model_file.shipped() and len(used[1]) == 2


def test_a_model_in_memory_moves_all(shot, suits, model):
    loaded = StrandModel.load(model)
    (used,) = groom_models.GroomModels(loaded).each(read_shot(shot).grooms)
    assert used[0] is loaded and len(used[1]) == 2


def test_the_threads_asked_for_are_those_of_a_model_in_memory_too(model):
    loaded = StrandModel.load(model, threads=2)
    assert groom_models.GroomModels(loaded).asked is groom_models.GroomModels(loaded, 2).asked is loaded
    again = groom_models.GroomModels(loaded, 1).asked
    assert again.threads == 1 and again.file is loaded.file and loaded.threads == 2


def test_an_export_is_of_one_model(shot, tmp_path, suits, model):
    out = tmp_path / "out"
    with pytest.raises(
        NeuralocksError, match="/Hero/Hair, /Hero/Other: different shipped models suit them; export each"
    ):
        export_model(None, out, shot)
    assert not list(out.glob("*")) if out.exists() else True
    export_model(None, out, shot, grooms=[OTHER])
    assert (out / "frame.onnx").read_bytes() == model_file.read(model).graphs["frame.onnx"]
