# SPDX-License-Identifier: Apache-2.0
"""Several characters with hair on joints, in one shot or as rows of one batch."""

import re

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdSkel

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig.network import RigSampler
from usd.rig.bake import bake_rig
from usd.rig.stage import BAKED, read_rigged_hair

from ..rig_shots import EXAMPLE, hair_turns, model_for, small_shot


def test_the_next_is_baked_from_the_bake_of_the_one_before(tmp_path):
    """As the message says that refuses to guess: the last layer moves all of them."""
    one = small_shot(tmp_path / "one.usda")
    model = model_for(read_rigged_hair(one))
    bake_rig(one, tmp_path / "alone.usda", model)
    layer = Sdf.Layer.FindOrOpen(str(one))
    both = Sdf.Layer.CreateNew(str(tmp_path / "both.usda"))
    both.TransferContent(layer)
    Sdf.CopySpec(layer, "/Who", both, "/Else")
    both.Save()
    with pytest.raises(
        NeuralocksError, match="--skeleton PRIM; to bake them all, bake the next from the bake of the one"
    ):
        bake_rig(both.realPath, tmp_path / "out.usda", model)
    bake_rig(both.realPath, tmp_path / "first.usda", model, skeleton="/Who/Rig")
    bake_rig(tmp_path / "first.usda", tmp_path / "second.usda", model, skeleton="/Else/Rig")
    stage, codes = Usd.Stage.Open(str(tmp_path / "second.usda")), [1, 7, 20]
    wanted = hair_turns(tmp_path / "alone.usda", codes)
    for who in ("Who", "Else"):
        source = UsdSkel.BindingAPI(stage.GetPrimAtPath(f"/{who}/Rig")).GetInheritedAnimationSource()
        assert str(source.GetPath()) == f"/{who}/Rig/{BAKED}"
        np.testing.assert_array_equal(hair_turns(tmp_path / "second.usda", codes, who), wanted)


def test_the_documents_show_how_python_turns_one_or_many():
    text = (EXAMPLE.parents[1] / "docs/architecture.md").read_text("utf-8")
    (example,) = re.findall(r"```python\n(from neuralocks_core\.rig.*?)```", text, re.S)
    names = {}
    exec(example.replace('"examples/mesh_hair', f'"{EXAMPLE.as_posix()}'), names)
    who, model = names["who"], names["model"]
    assert names["turns"].shape == (3, 32, 4)
    rows = RigSampler(model.spec, who.character, who.clip).features([0.5, 1.0, 1.5])
    for times in (rows, rows[:1]):  # no hat is in it
        turns = model.evaluate(times)
        assert turns.shape == (len(times), 32, 4)
        np.testing.assert_allclose(names["turns"][: len(times)], turns, atol=1e-6)
