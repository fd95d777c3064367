# SPDX-License-Identifier: Apache-2.0
"""What is asked of `train` reaches the scene and the training, or is refused before either is made."""

from types import SimpleNamespace

import pytest

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models import model_file

pytest.importorskip("torch", reason="the extra 'train' is not installed")
pytest.importorskip("onnx", reason="the extra 'train' is not installed")
from neuralocks_core.training.learning.moment_options import SelfSupervisedOptions
from neuralocks_core.training.learning.regression_options import RegressionOptions
from neuralocks_core.training.learning.selfsupervised import paper_boundary
from neuralocks_core.training.work_folder import BEGINNING, folder_beside
from tests.strand_models import write_random_model
from usd.models.train import begins_with, parsed, train


@pytest.fixture
def made(tmp_path, monkeypatch):
    """What scene and training were made from; neither is made."""
    made = SimpleNamespace(scene=None, training=None, model=tmp_path / "learned.neuralocks")
    write_random_model(made.model, 1.0)

    def scene(*arguments, **named):
        made.scene = arguments, named
        return SimpleNamespace(grooms=())

    def training(scene, *arguments, **named):
        assert scene == SimpleNamespace(grooms=())
        made.training = arguments, named
        return made.model

    monkeypatch.setattr("usd.models.training_scene.training_scene", scene)
    monkeypatch.setattr("neuralocks_core.training.train.train_strands", training)
    monkeypatch.setattr("sys.argv", ["neuralocks", "made", "so"])
    return made


@pytest.mark.parametrize("paper", [True, False])
def test_all_that_is_asked_for_is_passed_on(tmp_path, made, paper):
    out, told = tmp_path / "own.neuralocks", []
    folder_beside(out).mkdir()
    (folder_beside(out) / "inputs.json").touch()
    files = "who.usda", ["bob"], ["walk.bvh"]
    whose = {"skeleton": "/Who/Rig", "head": "kopf", "joints": {"neck": "hals"}}
    drawn = {"variations": 3, "gestures": {"bow": 2.0}, "progress": lambda *_: None, "tell": told.append}
    work = {"resume": True, "rollouts": 7, "processes": 2, "keep_work": True, "credits": ["somebody"]}
    kind = {"method": "selfsupervised", "paper": True} if paper else {}
    assert train(*files, out, {"seed": "5"}, **whose, **drawn, **work, **kind) == made.model
    inputs = {"spec": paper_boundary()} if paper else {}
    assert made.scene == (files, {"seed": 5, **whose, **drawn, **inputs})
    options = SelfSupervisedOptions.paper(seed=5) if paper else RegressionOptions(seed=5)
    heard = {name: drawn[name] for name in ("progress", "tell")}
    same = {"begin": None, "command": "neuralocks made so", "credits": ("somebody",)}
    assert made.training == ((out, options), {**work, **heard, **same})
    assert told == [model_file.read(made.model).shortcomings()]


def test_who_wants_to_hear_nothing_need_not(tmp_path, made):
    train("who.usda", ["bob"], [], tmp_path / "own.neuralocks", {}, begin="nothing")
    assert made.training[1]["begin"] is None


def test_a_training_that_began_with_a_model_does_not_go_on_with_nothing(tmp_path, made):
    out = tmp_path / "own.neuralocks"
    folder_beside(out).mkdir()
    (folder_beside(out) / "inputs.json").touch()
    train("who.usda", ["bob"], [], out, {}, begin="nothing", resume=True)
    (folder_beside(out) / BEGINNING).touch()
    train("who.usda", ["bob"], [], out, {}, begin="nothing")
    made.scene = None
    with pytest.raises(NeuralocksError, match=r"--begin nothing: the training in \S+ began with a model; resume with"):
        train("who.usda", ["bob"], [], out, {}, begin="nothing", resume=True)
    assert made.scene is None


def test_unless_it_is_asked_for_no_training_begins_with_a_model_of_another_method(made):
    """Even if all else is the same."""
    same = {name: getattr(RegressionOptions(), name) for name in ("output", "motion", "strand_map")}
    options = SelfSupervisedOptions(**same)
    assert begins_with("shipped", False, BoundarySpec(), options) == model_file.shipped()
    assert begins_with(None, False, BoundarySpec(), options) is None


def test_of_models_the_named_one_is_taken(made):
    with pytest.raises(NeuralocksError, match="learned.neuralocks: differs from this training in"):
        begins_with(made.model, False, BoundarySpec(linear="velocity"), RegressionOptions())


@pytest.mark.parametrize("words", [("true", "false"), ("yes", "no"), ("1", "0"), ("True", "NO")])
def test_yes_and_no_are_words_for_a_switch(words):
    assert [parsed(RegressionOptions, {"static": word})["static"] for word in words] == [True, False]
