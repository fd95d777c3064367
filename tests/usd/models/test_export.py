# SPDX-License-Identifier: Apache-2.0
"""What is exported says how to feed it."""

import json
import re
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.boundary.stepped import LONGEST
from neuralocks_core.deformation.clumping import CANTILEVER, Locks
from neuralocks_core.materials import Material
from neuralocks_core.models import model_file
from neuralocks_core.motion import G
from neuralocks_core.rig import RigModel
from neuralocks_core.rig.network import held_features
from neuralocks_core.rotation import from_vector
from neuralocks_core.wind import Wind
from tests.strand_models import write_random_model
from usd.models.description import SLIDERS
from usd.models.export import export_model
from usd.skel.clip_codes import CLOSE, STAND

from ..shots import write_shot

QUASI_STATIC = Path(__file__).resolve().parents[3] / "examples/mesh_hair/quasi_static.neuralocks"


@pytest.mark.parametrize(
    ("kind", "graph", "entry"), [("strands", "frame.onnx", "boundary vector"), ("rig", "rig.onnx", "features")]
)
def test_the_parts_of_the_input_are_those_of_the_graph(tmp_path, kind, graph, entry):
    export_model(model_file.shipped(kind), tmp_path)
    described = json.loads((tmp_path / "description.json").read_text("utf-8"))
    assert all(each["what"] for each in described["graphs"].values())
    assert len(described[entry]["bin weights"]) == len(described["model"]["boundary"]["bins"])
    parts = described[entry]["parts"]
    assert [0, *(end for _, end in parts.values())] == [
        *(start for start, _ in parts.values()),
        described[entry]["length"],
    ]
    (shape,) = described["graphs"][graph]["inputs"].values()
    assert all(word in described[entry]["how"]["clip"] for word in ("range", f"{STAND:g} s", f"{CLOSE:g} s"))
    assert shape[1] == described[entry]["length"] and parts.keys() <= described[entry]["how"].keys()


@pytest.mark.parametrize(
    ("linear", "chest", "told"),
    [("gravity", True, "f_k, s_k, c_k"), ("velocity", True, "v_k, s_k, c_k"), ("none", False, "s_k")],
)
def test_the_history_told_is_that_of_the_model(tmp_path, linear, chest, told):
    spec = BoundarySpec(linear=linear, chest=chest)
    export_model(write_random_model(tmp_path / "random.neuralocks", 1.0, spec, anchored=False), tmp_path)
    described = json.loads((tmp_path / "description.json").read_text("utf-8"))
    history = described["boundary vector"]["how"]["history"]
    assert f"is {told}, three numbers each" in history
    assert all((f"{step} =" in history) == (step in told) for step in ("f_k", "v_k", "s_k"))
    assert ("the same for the upper chest" in history) == chest
    assert ("the change is shortened to that length" in history) == (linear == "gravity")
    assert 1 / int(re.search(r"longer than 1/(\d+) s is a stop", history)[1]) == pytest.approx(LONGEST, abs=2e-3)


@pytest.mark.parametrize(("kind", "entry"), [("strands", "boundary vector"), ("rig", "features")])
def test_all_that_the_history_names_is_in_the_description(tmp_path, kind, entry):
    """And what happens to it where motion is held, ends, or loops."""
    export_model(model_file.shipped(kind), tmp_path, write_shot(tmp_path) if kind == "strands" else None)
    text = (tmp_path / "description.json").read_text("utf-8")
    history = json.loads(text)[entry]["how"]["history"]
    named = set(re.findall("`(\\w[^`]*)`", history))
    assert {name for name in named if f'"{name}":' not in text} == set()
    assert all(word in history for word in ("between two samples, t goes linearly", "`--loop`", "stands still"))


def test_the_description_of_a_rig_holds_no_weights(tmp_path):
    """They are in rig.onnx; in the text they were most of ten thousand lines."""
    _, path = sorted(export_model(model_file.shipped("rig"), tmp_path), key=lambda path: path.suffix == ".json")
    described = json.loads(path.read_text("utf-8"))
    model = described["model"]
    assert "layers" not in model and len(model["chains"]["axes"]) == len(RigModel.load().chains)


def test_what_makes_hair_start_anew_is_told_of_rigs_too(tmp_path):
    """And of those that answer to poses alone, neither that nor a history."""
    export_model(model_file.shipped("rig"), tmp_path)
    how = json.loads((tmp_path / "description.json").read_text("utf-8"))["features"]["how"]
    assert (
        "starts anew" in how["a cut"]
        and "Clear the samples at a cut" in how["a game"]
        and "weight" not in how["a game"]
    )
    assert "Motion strength is a factor" in how["history"] and how["wind"].startswith("add the binned steps")
    export_model(QUASI_STATIC, tmp_path)
    how = json.loads((tmp_path / "description.json").read_text("utf-8"))["features"]["how"]
    assert not {"a cut", "a game", "history", "clip", "wind"} & set(how)


def test_a_rig_is_fed_as_its_description_says(tmp_path):
    """A held pose, from the text alone: the first two columns of the rotation of neck and upper chest relative to the head."""
    export_model(model_file.shipped("rig"), tmp_path)
    described = json.loads((tmp_path / "description.json").read_text("utf-8"))["features"]
    head, neck, chest = from_vector(np.random.default_rng(0).normal(0, 0.4, (3, 3)))
    given = np.zeros((1, described["length"]), np.float32)
    given[0, slice(*described["parts"]["pose"])] = np.concatenate(
        [(head.T @ joint)[:, column] for joint in (neck, chest) for column in (0, 1)]
    )
    given[0, slice(*described["parts"]["gravity"])] = head.T @ [0, -1, 0]
    (turns,) = onnxruntime.InferenceSession(tmp_path / "rig.onnx").run(None, {"features": given})
    model = RigModel.load()
    relative = np.stack([head.T @ neck, head.T @ chest])[None]
    ours = model.evaluate(held_features(model.spec, relative, (head.T @ [0, -1, 0])[None]))
    assert turns == pytest.approx(ours, abs=1e-5)


@pytest.mark.parametrize(("mean", "period"), [((1.0, -2.0, 3.0), 0), ((1.0, -2.0, 3.0), 2.0), ((0.0, 3.0, 0.0), 0)])
def test_the_winds_of_a_bake_are_described_for_others(tmp_path, mean, period):
    """Computed from the words alone, also in a loop shorter than a gust; a model that feels none has no words for it."""
    export_model(model_file.shipped("strands"), tmp_path)
    told = json.loads((tmp_path / "description.json").read_text("utf-8"))["sliders"]["wind"]
    share = float(re.search(r"level vector ([\d.]+) times", told)[1])
    said = re.search(r"c ([\d., ]+), f ([\d., ]+) Hz, phases ([\d., ]+) and ([\d., ]+) rad", told)
    c, f, along, across = (np.array(part.split(", "), float) for part in said.groups())
    if period:
        least = re.search(r"in a loop, each f is rounded to whole turns in its length, (\w+) at least", told)[1]
        f = np.maximum(np.round(f * period), {"one": 1}[least]) / period
    wind, t = Wind(mean, 0.7), np.linspace(0, 9, 50)[:, None]
    a, b = ((c * np.sin(2 * np.pi * f * t + phase)).sum(axis=1)[:, None] for phase in (along, across))
    m, side = np.array(mean), np.array([mean[2], 0.0, -mean[0]])
    if not side.any():
        side = {"+X": np.array([1.0, 0.0, 0.0])}[re.search(r"or (\S+) if m is vertical", told)[1]]
    s = share * np.linalg.norm(m) * side / np.linalg.norm(side)
    assert m + 0.7 * (a * m + b * s) == pytest.approx(wind.at(t[:, 0], period), abs=1e-9)
    for spec, static in ((BoundarySpec(bins=()), True), (BoundarySpec(linear="velocity"), False), (None, True)):
        file = model_file.read(write_random_model(tmp_path / "held.neuralocks", gain=1.0, spec=spec))
        model_file.write(file.path, file.meta | {"static": static}, file.graphs)
        export_model(file.path, tmp_path / "held")
        sliders = json.loads((tmp_path / "held" / "description.json").read_text("utf-8"))["sliders"]
        assert set(sliders) == {*SLIDERS} - {"wind"}


def test_clumping_is_described_as_a_bake_has_it():
    told = re.search(
        r"f = \(k0 \+ (\S+) tie\) / \(k0 \+ 2 clumping tie\), k0 = (\S+) bend / length\^4 \+ (\S+) weight / length;",
        SLIDERS["clumping"],
    )
    usual, rod, pendulum = map(float, told.groups())
    length, tie, none = np.array([0.1, 0.3, 0.9]), np.array([0.0, 0.5, 1.2]), np.zeros(3)
    locks = Locks(none, none, none, rod / length**4, pendulum / length, tie)
    for own in (Material(), Material(bend=0.005, weight=2.0, clumping=200.0), Material(clumping=0.0)):
        held = rod * own.bend / length**4 + pendulum * own.weight / length
        wanted = (held + usual * tie) / (held + 2 * own.clumping * tie)
        ratios = own.log_ratios()
        ratios[0] -= ratios[1]  # a boundary vector has bend / weight
        np.testing.assert_allclose(locks.spread(ratios), wanted, rtol=1e-4)
    assert (rod, pendulum) == (CANTILEVER, G)
