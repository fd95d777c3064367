# SPDX-License-Identifier: Apache-2.0
"""A training that begins with a model: the same answers as the model at first, and better ones of it."""

from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models import model_file
from tests.core.rigs import person, straight_hair
from tests.strand_models import without_rest_points

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")
onnx = pytest.importorskip("onnx", reason="the extra 'train' is not installed")
pytest.importorskip("warp", reason="the extra 'train' is not installed")
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.models.network_sizes import PLAIN_STRAND, STRAND
from neuralocks_core.training.autoencoder import StrandAutoencoder
from neuralocks_core.training.data.rollouts import TrainingScene
from neuralocks_core.training.export import strand_graphs
from neuralocks_core.training.learning import methods
from neuralocks_core.training.learning.regression_options import RegressionOptions
from neuralocks_core.training.networks import StrandNet
from neuralocks_core.training.train import train_strands
from neuralocks_core.training.warm_start import Beginning
from neuralocks_core.training.work_folder import keep_beginning

SPEC = BoundarySpec()


def _normalised(motion, seed, spec=SPEC, strand_map="linear"):
    """A network of random weights and inputs of any mean and size, one of which never varies: another one for each seed."""
    torch.manual_seed(seed)
    net = StrandNet(spec.size, motion=motion, strand_map=strand_map)
    strands = torch.randn(50, STRAND) * torch.linspace(0.1, 3, STRAND) + torch.randn(STRAND)
    frames = torch.randn(50, spec.size) * torch.linspace(0.01, 5, spec.size) + torch.randn(spec.size)
    strands[:, PLAIN_STRAND - 1 - seed], frames[:, seed] = 0.3, 0.7
    net.set_normalisation(strands, frames, spec.slices["history"])
    return net, strands, frames


def _written(path, motion="modulated", output="direction", principal=True, strand_map="linear"):
    net, _, _ = _normalised(motion, 0, strand_map=strand_map)
    with torch.no_grad():
        for parameter in net.parameters():
            parameter.add_(0.05 * torch.randn_like(parameter))
    coder = StrandAutoencoder(principal=principal)
    coder.set_normalisation(torch.randn(100, 72))
    meta = {"kind": "strands", "boundary": SPEC.to_json(), "anchored": True, "static": False, "output": output}
    return model_file.write(path, {**meta, "credits": ["Hair: Rapunzel."]}, strand_graphs(coder, net, output))


@pytest.mark.parametrize(
    ("motion", "principal", "maps"),
    [
        ("linear", False, ("linear", "linear")),
        ("encoder", True, ("deep", "deep")),
        ("modulated", True, ("linear", "deep")),
        ("modulated", True, ("deep", "deep")),
    ],
)
def test_the_network_answers_as_the_model_does(tmp_path, motion, principal, maps):
    """However its inputs are normalised, and also for inputs that never varied in training."""
    path = _written(tmp_path / "a.neuralocks", motion, principal=principal, strand_map=maps[0])
    net, strands, frames = _normalised(motion, 1, strand_map=maps[1])
    if maps[1] == "deep":
        net.strand_encoder[-1].weight.data *= 100.0
    beginning = Beginning(path)
    beginning.fill(net)
    for seed in (0, 1):  # what the model never saw vary, and what the network's samples do not
        strands[:, PLAIN_STRAND - 1 - seed], frames[:, seed] = torch.linspace(0, 1, 50), -2
    graphs = model_file.read(path).graphs
    again = strand_graphs(beginning.coder(), net, "direction")
    shapes = 0.1 * torch.randn(9, 72).numpy()
    codes = [_run(g["encoder.onnx"], {"shape": shapes})["code"] for g in (graphs, again)]
    assert np.abs(codes[0] - codes[1]).max() < 1e-5 * np.abs(codes[0]).max()
    wanted, answer = (_offsets(g, strands.numpy(), frames[:1].numpy()) for g in (graphs, again))
    assert np.abs(answer - wanted).max() < 1e-3 * np.abs(wanted).max()


@pytest.mark.parametrize("motion", ["linear", "encoder", "modulated"])
def test_with_a_shorter_history_the_network_answers_as_the_model_does_where_nothing_was_before(tmp_path, motion):
    path = _written(tmp_path / "a.neuralocks", motion)
    short = replace(SPEC, bins=SPEC.bins[:-3], taper=0.2)
    net, strands, frames = _normalised(motion, 1, short)
    beginning = Beginning(path)
    beginning.check(short, RegressionOptions(motion=motion), resume=False)
    beginning.fill(net)
    longer = torch.nn.functional.pad(frames[:1], (0, SPEC.size - short.size)).numpy()
    wanted = _offsets(model_file.read(path).graphs, strands.numpy(), longer)
    answer = _offsets(strand_graphs(beginning.coder(), net, "direction"), strands.numpy(), frames[:1].numpy())
    assert np.abs(answer - wanted).max() < 1e-3 * np.abs(wanted).max()


def test_a_model_that_reads_no_rest_points_is_begun_with(tmp_path):
    path = _written(tmp_path / "a.neuralocks")
    file = model_file.read(path)
    graphs = without_rest_points(file.graphs)
    model_file.write(path, file.meta, graphs)
    net, strands, frames = _normalised("modulated", 1, strand_map="deep")
    beginning = Beginning(path)
    beginning.check(SPEC, RegressionOptions(), resume=False)
    beginning.fill(net)
    wanted = _offsets(graphs, strands[:, :PLAIN_STRAND].contiguous().numpy(), frames[:1].numpy())
    answer = _offsets(strand_graphs(beginning.coder(), net, "direction"), strands.numpy(), frames[:1].numpy())
    assert np.abs(answer - wanted).max() < 1e-3 * np.abs(wanted).max()


def _offsets(graphs, strands, frame):
    edges = np.tile(np.float32([0, -0.01, 0]), (len(strands), 24))
    inputs = {"anchor": 0 * edges, "edges": edges, **_run(graphs["strand.onnx"], {"strand": strands})}
    return _run(graphs["tail.onnx"], inputs | _run(graphs["frame.onnx"], {"frame": frame}))["offsets"]


def _run(graph, inputs):
    import onnxruntime

    session = onnxruntime.InferenceSession(graph, providers=["CPUExecutionProvider"])
    return dict(zip([o.name for o in session.get_outputs()], session.run(None, inputs)))


@pytest.mark.parametrize(
    ("changes", "spec", "differs"),
    [
        ({"output": "displacement"}, SPEC, "output"),
        ({"motion": "linear", "static": True}, SPEC, "static, motion"),
        ({"strand_map": "linear"}, SPEC, "strand_map"),
        ({}, BoundarySpec(bins=(1,) * 30), "boundary"),
        ({}, replace(SPEC, bins=(*SPEC.bins, 4)), "boundary"),
        ({}, replace(SPEC, bins=()), "boundary"),
        ({}, replace(SPEC, bins=SPEC.bins[:5], chest=False), "boundary"),
    ],
)
def test_a_model_of_another_kind_is_refused_before_anything_is_simulated(tmp_path, changes, spec, differs):
    path = _written(tmp_path / "a.neuralocks", strand_map="deep")
    scene = TrainingScene(person(), (straight_hair(),), spec=spec)
    with pytest.raises(NeuralocksError, match=f"a.neuralocks: differs from this training in {differs};"):
        train_strands(scene, tmp_path / "b.neuralocks", RegressionOptions(steps=1, **changes), begin=path)
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.neuralocks"]


def test_damaged_and_hostile_models_are_refused(tmp_path):
    """Files that are not graphs, lack a layer, or have their numbers in another file or of other sizes."""
    path = _written(tmp_path / "a.neuralocks")
    whole = model_file.read(path)

    def with_frame(data):
        return model_file.write(tmp_path / "b.neuralocks", whole.meta, whole.graphs | {"frame.onnx": data})

    graph = onnx.load_model_from_string(whole.graphs["frame.onnx"])
    outside, lacking, small = onnx.ModelProto(), onnx.ModelProto(), onnx.ModelProto()
    for copy in (outside, lacking, small):
        copy.CopyFrom(graph)
    tensor = outside.graph.initializer[0]
    tensor.ClearField("raw_data")
    tensor.data_location = onnx.TensorProto.EXTERNAL
    tensor.external_data.add(key="location", value="a.neuralocks")
    next(node for node in lacking.graph.node if node.output[0] == "flat").output[0] = "level"
    small.graph.initializer[0].dims[:] = [2, 2]
    for data in (
        b"",
        b"no graph",
        whole.graphs["frame.onnx"][:-5],
        *(m.SerializeToString() for m in (outside, lacking, small)),
    ):
        with pytest.raises(NeuralocksError, match="b.neuralocks"):
            Beginning(with_frame(data)).fill(StrandNet(SPEC.size, motion="modulated"))


def test_a_deep_map_of_a_strand_is_not_left_out(tmp_path):
    path = _written(tmp_path / "deep.neuralocks", strand_map="deep")
    with pytest.raises(
        NeuralocksError, match="built differently from this one .a deep map of a strand.; begin with another"
    ):
        Beginning(path).fill(StrandNet(SPEC.size, motion="modulated"))


def test_a_static_network_stays_static(tmp_path):
    net, _, _ = _normalised("modulated", 0)
    net.frame_scale[SPEC.slices["history"]] = 0
    coder = StrandAutoencoder()
    meta = {"kind": "strands", "boundary": SPEC.to_json(), "anchored": True, "static": True, "output": "direction"}
    path = model_file.write(tmp_path / "still.neuralocks", meta, strand_graphs(coder, net, "direction"))
    again, _, _ = _normalised("modulated", 1)
    again.frame_scale[SPEC.slices["history"]] = 0
    Beginning(path).fill(again)
    assert not again.frame_scale[SPEC.slices["history"]].any()


def test_what_was_trained_is_not_lost_to_a_wrong_word(tmp_path):
    """A file that is not a model, or a model that does not fit, is refused before an earlier training's folder is touched, and a
    resumed training only continues with what it began with."""
    scene = TrainingScene(person(), (straight_hair(),))
    work = tmp_path / "b.neuralocks.training"
    work.mkdir()
    (work / "checkpoint.npz").write_bytes(b"hours")
    path = _written(tmp_path / "a.neuralocks")
    for begin, options in ((tmp_path / "none.neuralocks", {}), (path, {"output": "displacement"})):
        with pytest.raises(NeuralocksError, match=begin.name):
            train_strands(scene, tmp_path / "b.neuralocks", RegressionOptions(steps=1, **options), begin=begin)
    with pytest.raises(NeuralocksError, match="a.neuralocks: the training in .* did not begin with it"):
        train_strands(scene, tmp_path / "b.neuralocks", RegressionOptions(steps=1), begin=path, resume=True)
    keep_beginning(path, work)
    with pytest.raises(NeuralocksError, match="in static; resume with the settings it began with$"):
        train_strands(scene, tmp_path / "b.neuralocks", RegressionOptions(steps=1, static=True), resume=True)
    assert (work / "checkpoint.npz").read_bytes() == b"hours"


def test_a_training_goes_on_where_the_model_was(few, in_one_process, tmp_path, monkeypatch):
    """Without a step it is as good as the model; killed, it does not need the model's file; its card tells both."""
    scene = TrainingScene(person(), (straight_hair(),), frames=40, strands=8)
    first = RegressionOptions(steps=20, clips=8, strands=6, rate=2e-2)
    path = train_strands(scene, tmp_path / "a.neuralocks", first, rollouts=4, credits=("Hair: Rapunzel.",))
    still = RegressionOptions(steps=1, clips=2, strands=2, rate=0.0)
    begun = train_strands(scene, tmp_path / "b.neuralocks", still, rollouts=4, begin=path, credits=("Motion: none.",))
    before, after = (model_file.read(p).meta for p in (path, begun))
    for name, value in before["report"]["held out"].items():
        assert after["report"]["held out"][name] == pytest.approx(value, abs=2e-3, rel=2e-3), name
    assert set(before["report"]) == {"held out"}
    assert after["report"]["held out, begun with"] == after["report"]["held out"]
    assert after["credits"] == ["Hair: Rapunzel.", "Motion: none."]
    assert after["training"]["began with"]["steps"] == 20

    def kill(done, total, message):
        if "first simulations" in message:
            assert total == 4 and message.endswith(f": {done} of 4")
            raise KeyboardInterrupt

    wait = methods.wait
    with monkeypatch.context() as said, pytest.raises(KeyboardInterrupt):
        # Simulations may all be there when they are first looked for.
        said.setattr(
            methods, "wait", lambda farm, count, say, **options: say(0, count) or wait(farm, count, say, **options)
        )
        train_strands(scene, tmp_path / "c.neuralocks", still, rollouts=4, begin=path, progress=kill)
    path.unlink()
    resumed = train_strands(scene, tmp_path / "c.neuralocks", still, rollouts=4, resume=True)
    assert model_file.read(resumed).meta["report"] == after["report"]
    assert not (tmp_path / "c.neuralocks.training").exists()
