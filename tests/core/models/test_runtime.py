# SPDX-License-Identifier: Apache-2.0
"""Inference: exact splitting, no dependence on chunks, the caller's mistakes named as such."""

import os
import subprocess
import sys

import numpy as np
import pytest

from neuralocks_core import materials
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.deformation.clumping import Locks
from neuralocks_core.deformation.strand_session import StrandSession, strand_inputs
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import RANGES
from neuralocks_core.models import model_file, runtime
from neuralocks_core.models.network_sizes import PLAIN_STRAND
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.strands.strand_set import scalp_local

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")
from neuralocks_core.training.export import strand_graphs  # noqa: E402
from neuralocks_core.training.networks import deform  # noqa: E402
from tests.strand_models import offsets_of, without_rest_points

SPEC = BoundarySpec()
CLUMPING = SPEC.slices["material"].start + list(RANGES).index("clumping")
UNREAD = SPEC.slices["material"].start + np.array(materials.UNREAD)


def test_split_inference_equals_the_whole_network(path, net, strands):
    vector, bind = np.random.default_rng(1).normal(size=(2, SPEC.size)).astype(np.float32)
    vector[UNREAD] = bind[UNREAD] = 0
    session = StrandSession(StrandModel.load(path), strands)
    session.anchor(bind)
    with torch.no_grad():
        inputs = torch.tensor(strand_inputs(strands, net[1].codes(scalp_local(strands))))
        offsets = offsets_of(net[0], inputs, torch.tensor(np.stack([vector, bind])))
        expected = deform(offsets[:1], torch.tensor(strands.rest), offsets[1:], path.stem)[0].numpy()
    expected[7] = 0
    assert np.abs(session.displacement(vector) - expected).max() < 1e-5
    assert np.array_equal(session.displacement(vector.tolist()), session.displacement(vector))


def test_what_the_network_does_not_read_is_named(path, strands):
    """As the caller's argument, not as damage of the model."""
    runner = StrandModel.load(path, threads=1)
    session = StrandSession(runner, strands.subset(slice(2)))
    for read in (session.displacement, session.anchor, runner.frame):
        with pytest.raises(NeuralocksError, match=r"vector: is of shape \(5,\); this model reads \(\d+,\)"):
            read(np.zeros(5))
        with pytest.raises(NeuralocksError, match=r"vector: is not an array of numbers; give \(\d+,\) of a boundary"):
            read("x")
    for rows, fact in (
        (None, "is not an array of numbers"),
        (np.zeros(72), "is of shape"),
        (np.zeros((2, 3)), "is of shape"),
    ):
        with pytest.raises(NeuralocksError, match=rf"^shape: {fact}.* \(n, 72\)"):
            runner.run("encoder.onnx", "code", shape=rows)
    for read in (session.displacement, session.anchor, runner.frame):
        with pytest.raises(NeuralocksError, match="^vector: holds NaN or infinity; give finite numbers"):
            read(np.full(runner.spec.size, np.nan))
    row, frame = np.zeros((1, 72)), runner.frame(np.zeros(runner.spec.size))
    tail = {"strand_part": np.zeros((2, 256)), "anchor": np.zeros((2, 72)), "edges": np.zeros((2, 72)), **frame}
    assert runner.run("tail.onnx", "offsets", **dict(reversed(tail.items()))).shape == (2, 72)
    for words, inputs, fact in (
        (("x.onnx", "code"), {"shape": row}, "graph 'x.onnx': is unknown; give one of encoder.onnx, strand.onnx"),
        (("encoder.onnx", "y"), {"shape": row}, "output 'y': is unknown; give one of code"),
        (("encoder.onnx", "code"), {}, "encoder.onnx: reads shape; give just these arrays"),
        (("encoder.onnx", "code"), {"shape": row, "anchor": row}, "encoder.onnx: reads shape; give just"),
        (("encoder.onnx", "code"), {"shape": row * np.nan}, "shape: holds NaN or infinity"),
        (
            ("tail.onnx", "offsets"),
            tail | {"edges": row},
            "tail.onnx: is given .* edges .1. rows; give as many",
        ),
        (
            ("tail.onnx", "offsets"),
            tail | {"frame_part": np.zeros((2, 256))},
            r"frame_part: is of shape \(2, 256\); tail.onnx reads \(1, 256\)",
        ),
        (
            ("tail.onnx", "offsets"),
            tail | {"strand_part": np.full((2, 256), np.nan)},
            "strand_part: holds NaN or infinity",
        ),
    ):
        with pytest.raises(NeuralocksError, match=f"^{fact}"):
            runner.run(*words, **inputs)
    for threads in (0, -1, 1.5, "2", True):
        with pytest.raises(NeuralocksError, match=rf"threads '?{threads}'?: must be a whole number from 1 on"):
            StrandModel.load(path, threads=threads)
    with pytest.raises(NeuralocksError, match="is a folder"):  # the current one, and not the shipped model
        StrandModel.load("")


def test_a_model_that_reads_no_rest_points_is_given_none(path, net, strands, tmp_path):
    file = model_file.read(path)
    plain = model_file.write(tmp_path / "plain.neuralocks", file.meta, without_rest_points(file.graphs))
    vector = np.random.default_rng(1).normal(size=SPEC.size).astype(np.float32)
    unread = net[0].strand.weight[:, PLAIN_STRAND:].clone()
    with torch.no_grad():
        net[0].strand.weight[:, PLAIN_STRAND:] = 0
        same = model_file.write(tmp_path / "same.neuralocks", file.meta, strand_graphs(net[1], net[0], path.stem))
        net[0].strand.weight[:, PLAIN_STRAND:] = unread
    moved = [StrandSession(StrandModel.load(each), strands).displacement(vector) for each in (plain, same)]
    assert np.abs(moved[0] - moved[1]).max() < 1e-6


def test_threads_and_chunks_give_the_same_bits(path, strands):
    vector = np.random.default_rng(2).normal(size=SPEC.size).astype(np.float32)
    whole = StrandSession(StrandModel.load(path, threads=2), strands).displacement(vector)
    session = StrandSession(StrandModel.load(path, threads=1), strands)
    parts = np.full_like(whole, np.nan)
    session.each(vector, lambda chunk, moved: parts.__setitem__(chunk, moved))
    assert np.array_equal(session.displacement(vector), whole) and np.array_equal(parts, whole)


def test_a_model_that_is_read_again_is_not_loaded_again(path, tmp_path):
    """Another of the same description is, even in the same file."""
    file = tmp_path / "copy.neuralocks"
    file.write_bytes(path.read_bytes())
    one, two = (runtime.graph_session(model_file.read(each), "tail.onnx") for each in (path, file))
    assert one is two
    changed = {
        **model_file.read(file).graphs,
        "tail.onnx": model_file.read(model_file.shipped("strands")).graphs["tail.onnx"],
    }
    model_file.write(file, model_file.read(file).meta, changed)
    assert runtime.graph_session(model_file.read(file), "tail.onnx") is not one


def test_the_held_bind_pose_is_exactly_the_groom(path, strands):
    bind = np.random.default_rng(3).normal(size=SPEC.size).astype(np.float32)
    session = StrandSession(StrandModel.load(path), strands)
    session.anchor(bind)
    assert not session.displacement(bind).any()


def test_clumping_draws_the_hairs_of_a_lock_together(path, strands):
    """How far they stray follows their own factors; the lock's own path does not change, the held bind pose is the groom whatever
    the clumping, and lengths are kept."""
    if path.stem == "displacement":
        pytest.skip("hair that stretches has no lengths to keep")
    rng = np.random.default_rng(5)
    vector, bind = (0.3 * rng.normal(size=(2, SPEC.size))).astype(np.float32)
    session = StrandSession(StrandModel.load(path), strands)
    ways, strays, factors = [], [], []
    counts = np.bincount(strands.lock)[strands.lock][:, None, None]
    for ratio in (-1.0, 0.0, 1.0):
        vector[CLUMPING] = bind[CLUMPING] = ratio
        session.anchor(bind)
        assert not session.displacement(bind).any()
        moved = session.displacement(vector)
        chunks = np.empty_like(moved)
        session.each(vector, chunks.__setitem__)
        assert chunks.tobytes() == moved.tobytes()
        if ratio:
            lengths = [np.linalg.norm(np.diff(x, axis=1), axis=2) for x in (strands.rest, strands.rest + moved)]
            np.testing.assert_allclose(*lengths, atol=1e-6)
        way = np.zeros((strands.lock.max() + 1, *moved.shape[1:]))
        np.add.at(way, strands.lock, moved / counts)
        ways.append(way)
        strays.append(np.sqrt(np.square(moved - way[strands.lock]).mean()))
        factors.append(Locks.of(strands).spread(vector[SPEC.slices["material"]]))
    assert factors[0].max() > strays[0] / strays[1] > 1.1
    assert factors[2].min() < strays[2] / strays[1] < 0.9
    apart = [np.sqrt(np.square(way - ways[1]).mean()) for way in ways]
    assert max(apart) < 0.5 * np.sqrt(np.square(ways[1]).mean())


def test_a_little_clumping_changes_little(path, strands):
    """Also for hair that the network stretches: its lengths are the network's, not those at rest."""
    vector = (0.3 * np.random.default_rng(6).normal(size=SPEC.size)).astype(np.float32)
    session, moved = StrandSession(StrandModel.load(path), strands), []
    for ratio in (0.0, 1e-5):
        vector[CLUMPING] = ratio
        moved.append(session.displacement(vector))
    assert np.abs(moved[0]).max() > 0.005 and not np.array_equal(*moved)
    np.testing.assert_allclose(*moved, atol=2e-5)


def test_what_strands_share_is_computed_once_a_frame(path, strands, monkeypatch):
    session = StrandSession(StrandModel.load(path), strands)
    vector = np.zeros(SPEC.size, np.float32)
    vector[CLUMPING] = 1.0
    session.anchor(vector)
    session.displacement(vector)  # the locks are anchored in the first
    asked, frame = [], session.model.frame
    monkeypatch.setattr(session.model, "frame", lambda vector: asked.append(vector) or frame(vector))
    session.displacement(vector)
    assert len(asked) == 1


def test_lengths_are_kept(path, strands):
    if path.stem == "displacement":
        pytest.skip("only the direction output keeps lengths by construction")
    vector = 3 * np.random.default_rng(4).normal(size=SPEC.size).astype(np.float32)
    points = strands.rest + StrandSession(StrandModel.load(path), strands).displacement(vector)
    before = np.linalg.norm(np.diff(strands.rest, axis=1), axis=2)
    assert np.abs(np.linalg.norm(np.diff(points, axis=1), axis=2) - before).max() < 1e-6


def test_the_runtime_imports_without_torch_usd_or_blender():
    code = (
        "import sys\n"
        "for name in ('torch', 'pxr', 'bpy', 'onnx', 'warp'): sys.modules[name] = None\n"
        "import neuralocks_core.models.runtime, neuralocks_core.groom, neuralocks_core.hairstyles, neuralocks_core.formats"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_nothing_is_reported_and_nothing_kept_in_the_home_folder(tmp_path):
    """By default, onnxruntime reports to its maker what was run, from a database and an identifier that it puts there."""
    code = (
        "from neuralocks_core.models import model_file\n"
        "from neuralocks_core.models.runtime import graph_session\n"
        "graph_session(model_file.read(model_file.shipped('strands')), 'tail.onnx')"
    )
    silent = ("CI", "GITHUB_ACTIONS", "ORT_DISABLE_TELEMETRY", "ORT_RUNNING_UNIT_TESTS", "XDG_CACHE_HOME")
    environment = {name: value for name, value in os.environ.items() if name not in silent}
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, env=environment | {"HOME": str(tmp_path)}
    )
    assert not done.stderr and list(tmp_path.iterdir()) == []
