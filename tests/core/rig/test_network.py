# SPDX-License-Identifier: Apache-2.0
"""One network in numpy and ONNX: the same answers, one at a time and many, and a file that keeps them."""

from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models import model_file
from neuralocks_core.rig import RigModel
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.graph import rig_graph
from tests.core.rig.builders import model_of, random_features, random_model


@pytest.mark.parametrize("kind", ["static", "dynamic", "shipped"])
def test_onnx_agrees_with_numpy(kind):
    """Within 1e-6 on 10,000 random inputs."""
    ort = pytest.importorskip("onnxruntime")
    pytest.importorskip("onnx")
    model = model_of(kind)
    features = random_features(model, 10_000)
    ours = model.evaluate(features)
    session = ort.InferenceSession(rig_graph(model), providers=["CPUExecutionProvider"])
    assert np.abs(ours - session.run(None, {"features": features})[0]).max() < 1e-6
    assert [given.shape for given in (*session.get_inputs(), *session.get_outputs())] == [
        ["avatars", model.inputs],
        ["avatars", len(model.chains), 4],
    ]
    assert np.abs(np.linalg.norm(ours, axis=-1) - 1).max() < 1e-6


@pytest.mark.parametrize("kind", ["static", "dynamic", "shipped"])
@pytest.mark.parametrize("damage", [np.nan, np.inf, -np.inf])
def test_a_damaged_avatar_stays_bounded_and_alone(kind, damage):
    """NaN counts as the smallest value read, as in the C header; no other row of the batch changes by a bit."""
    ort = pytest.importorskip("onnxruntime")
    pytest.importorskip("onnx")
    model = model_of(kind)
    features = random_features(model, 9)
    broken = features.copy()
    broken[2, 3] = broken[5] = damage
    stands_for = features.copy()
    stands_for[2, 3] = stands_for[5] = 1e9 if damage > 0 else -1e9
    graphs = [rig_graph(model)]
    if kind == "shipped":  # `export` writes what the file holds
        graphs.append(model_file.read(model_file.shipped("rig")).graphs["rig.onnx"])
    sessions = [ort.InferenceSession(graph, providers=["CPUExecutionProvider"]) for graph in graphs]
    runs = [model.evaluate, *(lambda f, s=s: s.run(None, {"features": f})[0] for s in sessions)]
    for run in runs:
        turns = run(broken)
        assert np.abs(np.linalg.norm(turns, axis=-1) - 1).max() < 1e-6
        np.testing.assert_array_equal(np.delete(turns, [2, 5], axis=0), np.delete(run(features), [2, 5], axis=0))
        np.testing.assert_array_equal(turns, run(stands_for))


def test_batch_and_single_agree():
    """One avatar is a row of the batch."""
    model = random_model()
    features = random_features(model, 50)
    np.testing.assert_allclose(model.evaluate(features)[7], model.evaluate(features[7]), atol=1e-6)


@pytest.mark.parametrize("kind", ["static", "dynamic"])
def test_what_is_sent_beyond_the_limits_is_cut_off(kind):
    """Wrong input turns no joint farther than the largest motion that is read."""
    model = model_of(kind)
    far = 1e4 * random_features(model, 50)
    np.testing.assert_array_equal(model.evaluate(far), model.evaluate(np.clip(far, -model.limits, model.limits)))
    assert np.abs(model.evaluate(far) - model.evaluate(far / 1e4)).max() > 1e-3


def test_a_report_that_ran_away_is_not_written(tmp_path):
    """The remedy is an option of `rig train`, which has no --set."""
    pytest.importorskip("onnx")
    bad = replace(random_model(), report={"loss": np.inf})
    with pytest.raises(NeuralocksError, match="m.neuralocks: .* NaN .*; give --bend, --weight and --damping nearer"):
        bad.save(tmp_path / "m.neuralocks")
    assert not list(tmp_path.iterdir())


def test_model_file_round_trip(tmp_path):
    """Bit for bit, and damage is reported in one line."""
    pytest.importorskip("onnx")
    model = random_model()
    path = model.save(tmp_path / "m.neuralocks")
    again = RigModel.load(path)
    features = random_features(model, 20)
    assert (again.evaluate(features) == model.evaluate(features)).all()
    file = model_file.read(path)
    for meta, fact in (
        ({"boundary": {"pose_joints": [[]]}}, "wrong kind"),
        ({"layers": 5}, "description is unreadable"),
    ):
        with pytest.raises(NeuralocksError, match=f"odd.neuralocks: .*{fact}; get"):
            RigModel.load(model_file.write(tmp_path / "odd.neuralocks", {**file.meta, **meta}, file.graphs))
    few = {name: value for name, value in file.meta.items() if name != "limits"}
    with pytest.raises(NeuralocksError, match="odd.neuralocks: its description lacks 'limits'; get"):
        RigModel.load(model_file.write(tmp_path / "odd.neuralocks", few, file.graphs))
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(NeuralocksError, match="m.neuralocks"):
        RigModel.load(path)
    with pytest.raises(NeuralocksError, match="numbers per avatar"):
        model.evaluate(np.zeros(7))


@pytest.mark.parametrize(
    ("forged", "said"),
    [
        ({"chain": [99] * 16}, "another chain than its parent"),
        ({"chain": [-1] * 16}, "another chain than its parent"),
        ({"chain": [0, 1, *[0] * 14]}, "another chain than its parent"),
        ({"parents": [3] * 16}, "comes before its parent"),
        ({"parents": [0] + [-1] * 15}, "comes before its parent"),
        ({"parents": [-2] + [-1] * 15}, "comes before its parent"),
        ({"bone_joint": [40] * 16}, "names a joint that is not there"),
        ({"bone_joint": [-1] * 16}, "names a joint that is not there"),
        ({"bone_end": [16] * 16}, "names a joint that is not there"),
        ({"names": [1] * 16}, "unreadable hair chains"),
        ({"joints": ["x"] * 16}, "unreadable hair chains"),
        ({"bones": [[0, 1, 0]]}, r"bones is \(1, 3\), not \(16, 3\)"),
        ({"origins": [[np.nan, 0, 0]] * 16}, "NaN or infinity in the bind pose"),
    ],
)
def test_forged_chains_are_refused_in_one_line(forged, said):
    values = random_model().chains.to_json()
    assert len(HairChains.from_json(values)) == 16
    with pytest.raises(NeuralocksError, match=said):
        HairChains.from_json(values | forged)


def test_layers_and_limits_that_do_not_fit_are_refused():
    """Those of a damaged or forged file, each by its own fact; a NaN would be the turn of each joint."""
    model = random_model()
    (first, bias), *others = model.layers
    for layers, fact in (
        (((first[:, 1:], bias), *others), "layers do not fit together"),
        (((first, bias[1:]), *others), "layers do not fit together"),
        (((first, bias), *others, *others), "layers do not fit together"),
        (((first[:, :, None], bias), *others), "layers do not fit together"),
        (((first[0], bias), *others), "layers do not fit together"),
        (((first, bias),), "does not give three numbers per hair joint"),
        (((first * np.nan, bias), *others), "NaN or infinity in its weights"),
        (((first, bias + np.inf), *others), "NaN or infinity in its weights"),
        # A later layer could make little of it, of infinity minus infinity nothing.
        (
            ((first, bias + np.float32(3e38)), (np.float32(1e-38) * others[0][0], others[0][1]), *others[1:]),
            "too large",
        ),
    ):
        with pytest.raises(NeuralocksError, match=f"model: .*{fact}.*; get an undamaged copy"):
            replace(model, layers=layers)
    for damage in (
        {"limits": model.limits[1:]},
        {"limits": np.nan * model.limits},
        {"limits": np.where(np.arange(model.inputs), model.limits, np.inf)},
        {"limits": -model.limits},
        {"max_angle": 0.0},
        {"max_angle": 3.2},
    ):
        with pytest.raises(NeuralocksError, match="input limits do not fit its inputs"):
            replace(model, **damage)


@pytest.mark.parametrize(
    "given", [None, "x", {}, [[1, 2], [3]], np.array(["a"]), 1j, [10**400], np.datetime64("2020-01-01")]
)
def test_features_that_are_no_numbers_are_refused(given):
    model = random_model()
    for read in (model.evaluate, model.canonical_turns):
        with pytest.raises(
            NeuralocksError, match=rf"features: is not an array of numbers; give {model.inputs} numbers per avatar"
        ):
            read(given)


def test_features_of_another_shape_are_refused_and_huge_ones_cut_off():
    model = random_model()
    for read in (model.evaluate, model.canonical_turns):
        for shape in ((), (3,), (0,), (2, 3, 4), (1, 2, model.inputs)):
            with pytest.raises(
                NeuralocksError, match=rf"features: are of shape .*; this model reads {model.inputs} numbers per avatar"
            ):
                read(np.zeros(shape))
        same = [read(np.full(model.inputs, huge)) for huge in (1e300, 1e6)]
        np.testing.assert_array_equal(*same)
