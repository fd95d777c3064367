# SPDX-License-Identifier: Apache-2.0
"""What is asked of `train_rig` reaches the rig and its training, and what a user should know is told before and after."""

from types import SimpleNamespace

import pytest
from pxr import Sdf, Usd, UsdGeom

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig import RigModel
from usd.rig import train as module
from usd.rig.train import train_rig

from ..rig_shots import model_for, small_shot

pytest.importorskip("torch", reason="the extra 'train' is not installed")
pytest.importorskip("onnx", reason="the extra 'train' is not installed")
pytest.importorskip("warp", reason="the extra 'train' is not installed")


@pytest.fixture
def made(tmp_path, monkeypatch):
    """A rig with two skeletons and odd names, and what its training was made from; it is not made."""
    made, read = SimpleNamespace(heard=[], read=None, training=None), module.read_rigged_hair
    stage = Usd.Stage.Open(str(small_shot(tmp_path / "who.usda")))
    for path in ("/Who/Rig", "/Who/Motion"):
        joints = stage.GetPrimAtPath(path).GetAttribute("joints")
        joints.Set([name.replace("head", "kopf").replace("hair", "strip") for name in joints.Get()])
    layer = stage.GetRootLayer()
    Sdf.CopySpec(layer, "/Who", layer, "/Other")
    UsdGeom.XformCommonAPI(stage.GetPrimAtPath("/Other")).SetTranslate((1, 0, 0))
    layer.Save()

    def reading(*arguments, **named):
        made.read = arguments, named
        return read(*arguments, **named)

    def training(kind):
        def train(rig, material, **named):
            made.training = kind, rig, material, named
            made.heard.append("training")
            made.model = model_for(SimpleNamespace(rig=rig), kind == "dynamic")
            made.model.report["motion_error"] = {"dynamic network": 2.0}
            return made.model

        return train

    monkeypatch.setattr("usd.rig.train.read_rigged_hair", reading)
    for kind in ("static", "dynamic"):
        monkeypatch.setattr(f"neuralocks_core.training.rig.{kind}.train_{kind}", training(kind))
    monkeypatch.setattr("sys.argv", ["neuralocks", "made", "so"])
    return made


@pytest.mark.parametrize("early", [True, False])
def test_all_that_is_asked_for_is_passed_on(tmp_path, made, early):
    shot, out = tmp_path / "who.usda", tmp_path / "m.neuralocks"
    whose = {"skeleton": "/Who/Rig", "head": "kopf", "chains": ["strip_0"], "joints": {"neck": "hips"}}
    size = {"seconds": 2.0, "steps": 3, "hidden": 4, "clips": 5, "seed": 6, "progress": lambda *_: None}
    material = {"bend": 0.1, "weight": 2.0, "damping": 3.0}
    learned = train_rig(shot, out, **whose, **size, material=material, early=early, tell=made.heard.append)
    assert made.read == ((shot,), {**whose, "all_shapes": True}) and learned is made.model
    kind, rig, values, named = made.training
    assert kind == "dynamic" and rig.chains.names == ("strip_0", "strip_1", "strip_2")
    assert vars(values).items() >= material.items()
    keep = named.pop("keep")
    assert named == size and (keep is not None) == early
    before, during, after = made.heard
    assert during == "training" and any("it skins no body mesh" in note for note in before)
    assert not any("not moved" in note for note in before), "who names chains knows"
    assert [note.startswith(f"{out}: ") for note in after] == [True]
    card = RigModel.load(out).training
    assert card.items() >= {"character": "who.usda", "facing": 0.0, "command": "neuralocks made so"}.items()
    assert card["reads"] == {"head": "kopf", "neck": "hips", "upper_chest": "hips"} and "began with" not in card


def test_what_is_left_out_is_left_to_the_training(tmp_path, made):
    """And who wants to hear nothing need not. Of held poses, material and width come with the model to begin with."""
    shot, first, out = (tmp_path / name for name in ("who.usda", "first.neuralocks", "m.neuralocks"))
    whose = {"skeleton": "/Who/Rig", "head": "kopf", "chains": ["strip_0"], "dynamic": False}
    train_rig(shot, first, **whose)
    kind, _, _, named = made.training
    assert kind == "static" and named == {"seed": 0, "keep": None, "progress": None}
    with pytest.raises(NeuralocksError, match="who.usda: 2 skeletons have hair chains"):
        train_rig(shot, out, head="kopf", chains=["strip_0"])
    with pytest.raises(NeuralocksError, match="--chains tail: no joint of the hair has such a name"):
        train_rig(shot, out, **{**whose, "chains": ["strip_0", "tail"]})
    made.model.training["material"] = {"bend": 0.03, "weight": 2.0}
    made.model.save(first)
    again = train_rig(shot, out, **whose, begin=first, material={"weight": 1.5})
    _, _, values, named = made.training
    assert (values.bend, values.weight) == (0.03, 1.5) and named["begin"].training["material"]["bend"] == 0.03
    assert again.training["began with"]["command"] == "neuralocks made so"
