# SPDX-License-Identifier: Apache-2.0
"""What `rig train` refuses before it reads anything: what it needs and lacks, and numbers that no training can use."""

import sys
from dataclasses import replace

import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models.model_file import shipped
from neuralocks_core.rig import RigModel, rig_spec
from usd.models.train import train
from usd.rig.stage import read_rigged_hair
from usd.rig.train import train_rig
from usd.rig.warm_start import Beginning

from ...core.rig.builders import random_model, random_rig_model
from ..rig_shots import EXAMPLE, small_shot


@pytest.mark.parametrize("package", ["torch", "onnx", "warp"])
def test_what_is_missing_is_told_before_anything_is_read(tmp_path, monkeypatch, package):
    """Not after minutes of training, when the model is written."""
    for other in {"torch", "onnx", "warp"} - {package}:
        pytest.importorskip(other, reason="the extra 'train' is not installed")
    monkeypatch.setitem(sys.modules, package, None)
    none, out = tmp_path / "none.usda", tmp_path / "m.neuralocks"
    for work in (lambda: train_rig(none, out), lambda: train(none, ["library"], [], out, {})):
        with pytest.raises(NeuralocksError, match=rf"{package} is not installed; pip install \"neuralocks\[train\]\""):
            work()


@pytest.mark.parametrize("kind", ["ImportError", "OSError"])
def test_what_is_there_and_does_not_load_is_not_called_missing(tmp_path, monkeypatch, kind):
    (tmp_path / "torch.py").write_text(f"raise {kind}('libcudart.so.12: cannot open\\n shared object file')")
    monkeypatch.delitem(sys.modules, "torch", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(
        NeuralocksError,
        match=r"torch does not load \(libcudart.so.12: cannot open shared object file\); reinstall it",
    ):
        train_rig(tmp_path / "none.usda", tmp_path / "m.neuralocks")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"seconds": 0.5}, "--seconds 0.5: must be a number from 1 to 86400"),
        ({"steps": 0}, "--steps 0: must be a whole number from 1"),
        ({"steps": 2.5}, "--steps 2.5: must be a whole number from 1"),
        ({"hidden": 0}, "--hidden 0: must be a whole number from 1 to 256"),
        ({"clips": 1}, "--clips 1: must be a whole number from 2 to 10000"),
        ({"material": {"bend": float("nan")}}, "--bend nan: must be a number from 1e-06 to 10000"),
        ({"seed": -1}, "--seed -1: must be a whole number"),
        ({"dynamic": False, "clips": 8}, "have no effect on held poses; leave out --quasi-static"),
        ({"dynamic": False, "material": {"damping": 2.0}}, "have no effect on held poses"),
    ],
)
def test_numbers_that_no_training_can_use_are_refused(tmp_path, given, said):
    with pytest.raises(NeuralocksError) as caught:
        train_rig(tmp_path / "none.usda", tmp_path / "m.neuralocks", **given)
    assert said in str(caught.value)


def test_a_name_that_no_model_can_have_is_refused_before_training(tmp_path):
    """Not when what was learned in minutes is written."""
    pytest.importorskip("torch")
    shot = small_shot(tmp_path / "who.usda")
    before = shot.read_bytes()
    (folder := tmp_path / "folder.neuralocks").mkdir()
    for out, said in ((shot, "a model file ends in .neuralocks; choose such a name"), (folder, "is a folder; give a")):
        with pytest.raises(NeuralocksError, match=f"{out.name}: {said}"):
            train_rig(shot, out, dynamic=False, steps=1, progress=lambda *_: pytest.fail("it is trained"))
    assert shot.read_bytes() == before


def test_a_model_that_cannot_be_trained_on_is_refused(tmp_path):
    """Before the rig is read, or before anything is simulated."""
    pytest.importorskip("torch")
    out, shot = tmp_path / "m.neuralocks", small_shot(tmp_path / "who.usda")
    still, other, odd = EXAMPLE / "quasi_static.neuralocks", tmp_path / "other.neuralocks", tmp_path / "odd.neuralocks"
    random_model((2, 3), spec=rig_spec()).save(other)
    replace(RigModel.load(still), training={"material": {"bend": "stiff"}}).save(odd)
    for given, said in (
        (
            {"begin": still},
            "quasi_static.neuralocks: it is quasi-static; train with --quasi-static, or begin with another",
        ),
        ({"begin": shipped("rig"), "dynamic": False}, "rig.neuralocks: it is dynamic; train with --dynamic, or begin"),
        (
            {"begin": still, "dynamic": False, "hidden": 8},
            "--hidden: the model of --begin has layers of 16; leave one of",
        ),
        ({"begin": other, "dynamic": False}, r"other.neuralocks: model: .*hair"),
        (
            {"begin": odd, "dynamic": False, "character": EXAMPLE / "character.usda"},
            "odd.neuralocks: model: its bend 'stiff': must",
        ),
        ({"begin": tmp_path / "none.neuralocks"}, "none.neuralocks"),
    ):
        with pytest.raises(NeuralocksError, match=said):
            train_rig(**{"character": shot, "out": out} | given)
    assert not out.exists()


def test_a_model_of_another_network_or_other_chains_is_refused(tmp_path, monkeypatch):
    """What would otherwise begin with wrong weights."""
    still, model = RigModel.load(EXAMPLE / "quasi_static.neuralocks"), tmp_path / "m.neuralocks"
    replace(still, max_angle=2.0).save(model)
    with pytest.raises(NeuralocksError, match="m.neuralocks: its network is built differently from this one"):
        Beginning(model, False, None)
    some = read_rigged_hair(EXAMPLE / "character.usda", chains=["hair_nape_l_1"]).rig.chains
    assert 0 < len(some) < len(still.chains)
    random_rig_model(some, rig_spec(), 16, 0).save(model)
    said = f"its {len(some)} joints are not the {len(still.chains)} of this rig in the same order; "
    with pytest.raises(NeuralocksError, match=said + r"name its chains as in its training \(--chains hair_nape_l_1\)"):
        Beginning(model, False, None).check(still.chains)
    tops = still.chains.tops[:5]
    random_rig_model(read_rigged_hair(EXAMPLE / "character.usda", chains=[*tops]).rig.chains, rig_spec(), 16, 0).save(
        model
    )
    for few, named in ((4, "".join(f"--chains {top} " for top in tops[:4]) + "..."), (5, f"--chains {tops[4]}")):
        monkeypatch.setattr("usd.rig.warm_start._FEW", few)
        with pytest.raises(
            NeuralocksError, match=rf"name its chains as in its training \(.*{named}\), or train without"
        ):
            Beginning(model, False, None).check(still.chains)


def test_a_model_that_tells_no_material_has_none(tmp_path):
    still, model = RigModel.load(EXAMPLE / "quasi_static.neuralocks"), tmp_path / "m.neuralocks"
    for training in ({}, {"material": "soft"}, {"material": {"colour": 1.0}}):
        replace(still, training=training).save(model)
        assert Beginning(model, False, None).material() == {}


def test_a_card_says_what_training_began_with(tmp_path, monkeypatch):
    pytest.importorskip("torch")
    monkeypatch.setattr("sys.argv", ["neuralocks", "made", "so"])
    shot, first, then = (tmp_path / name for name in ("who.usda", "first.neuralocks", "then.neuralocks"))
    small = {"steps": 2, "dynamic": False}
    train_rig(small_shot(shot), first, hidden=4, material={"bend": 0.03, "weight": 2.0}, **small)
    card = train_rig(shot, then, begin=first, material={"weight": 1.5}, **small).training
    assert card["hidden"] == 4 and (card["material"]["bend"], card["material"]["weight"]) == (0.03, 1.5)
    assert card["began with"].items() >= {"command": "neuralocks made so", "steps": 2, "seed": 0}.items()


@pytest.mark.parametrize("early", [True, False])
@pytest.mark.parametrize("kind", ["static", "dynamic"])
def test_who_stops_while_the_report_is_measured_keeps_the_model(tmp_path, monkeypatch, kind, early):
    """The report takes minutes, and what it measures is learned by then. A button that cancels leaves nothing."""
    pytest.importorskip("torch")

    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(f"neuralocks_core.training.rig.{kind}.static_report", stop)
    monkeypatch.setattr("sys.argv", ["neuralocks", "made", "so"])
    out, told, dynamic = tmp_path / "m.neuralocks", [], kind == "dynamic"
    small = {"steps": 2, "hidden": 4, "early": early, "clips": 2 if dynamic else None}
    with pytest.raises(KeyboardInterrupt):
        train_rig(small_shot(tmp_path / "who.usda"), out, dynamic=dynamic, tell=told.extend, **small)
    assert out.exists() == early == any("is written, but without its report" in note for note in told)
    if early:
        kept = RigModel.load(out)
        assert (
            kept.training["command"] == "neuralocks made so"
            and kept.training["character"] == "who.usda"
            and not kept.report
        )
