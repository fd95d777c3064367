# SPDX-License-Identifier: Apache-2.0
"""Benchmarks say in words what they lack."""

import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import RANGES
from neuralocks_core.models import model_file
from neuralocks_core.models.runtime import StrandModel
from tests.usd.rig_shots import EXAMPLE, small_shot


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            ModuleNotFoundError("No module named 'trimesh'", name="trimesh"),
            'trimesh: is not installed; pip install ".[test]"',
        ),
        (NeuralocksError("no.bvh: no such file"), "no.bvh: no such file"),
    ],
)
def test_a_missing_extra_is_told_without_a_traceback(error, said, monkeypatch, capsys):
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "benchmarks")
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)
    monkeypatch.setattr(sys, "argv", ["benchmarks/reference_speed.py"])
    import_module("plain_errors").told(type(error), error, None)
    assert capsys.readouterr().err == f"reference_speed: {said}\n"


def test_other_errors_keep_their_traceback(monkeypatch, capsys):
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "benchmarks")
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)
    import_module("plain_errors").told(ModuleNotFoundError, ModuleNotFoundError("no numpy", name="numpy"), None)
    assert "ModuleNotFoundError: no numpy" in capsys.readouterr().err


def test_a_livelier_model_takes_acceleration_and_damping_for_so_many_times_and_nothing_else(monkeypatch, tmp_path):
    pytest.importorskip("torch", reason="the extra 'train' is not installed")
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "benchmarks")
    shipped = model_file.shipped()
    livelier = import_module("livelier").livelier(shipped, 1.5, tmp_path / "livelier.neuralocks", damping=1.25)
    before, after = (StrandModel.load(path) for path in (shipped, livelier))
    spec = before.spec
    random = np.random.default_rng(0)
    vector = random.normal(0, 0.1, spec.size).astype(np.float32)
    vector[spec.slices["history"]] = 0
    damping = spec.slices["material"].start + list(RANGES).index("damping")
    vector[damping] = 0
    damped, more = vector.copy(), vector.copy()
    damped[damping], more[damping] = 0.4, 1.25 * 0.4
    assert_close(after.frame(damped), before.frame(more))
    assert_close(after.frame(vector), before.frame(vector))
    pushed, spun = vector.copy(), vector.copy()
    history = random.normal(0, 0.1, (len(spec.bins), spec.per_bin)).astype(np.float32)
    spun[spec.slices["history"]] = np.where(np.arange(spec.per_bin) < 3, 0, history).ravel()
    assert_close(after.frame(spun), before.frame(spun))
    pushed[spec.slices["history"]] = history.ravel()
    more = pushed.copy()
    more[spec.slices["history"]] = np.where(np.arange(spec.per_bin) < 3, 1.5 * history, history).ravel()
    assert_close(after.frame(pushed), before.frame(more))
    assert (
        model_file.read(livelier).meta["training"]["livelier"]
        == "acceleration of the head, times 1.5; damping, times 1.25"
    )


def test_how_far_hairs_of_a_lock_part_leaves_out_where_the_lock_goes(monkeypatch):
    pytest.importorskip("torch", reason="the extra 'train' is not installed")
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "benchmarks")
    benchmark = import_module("selfsupervised")
    random = np.random.default_rng(0)
    solved = random.integers(-1000, 1000, (5, 4, 24, 3)).astype(np.int16)
    groom = SimpleNamespace(lock=np.array([7, 3, 3, 7]))
    held = SimpleNamespace(rollouts=[SimpleNamespace(groom=0, strands=np.arange(4), moved=solved, step=1e-3, first=2)])

    def parts(answer):
        monkeypatch.setattr(benchmark, "predicted", lambda *_: answer)
        return benchmark.parting(None, (groom,), held, benchmark.OURS)

    away = random.normal(size=(5, 1, 24, 3)) * np.array([1, 2, 2, 1])[:, None, None]  # the same within a lock
    assert parts(solved * 1e-3 + away) == pytest.approx(1, abs=1e-5)
    assert parts(solved * 4e-4 + away) == pytest.approx(0.4, abs=1e-5)
    assert parts(np.broadcast_to(away, solved.shape)) == pytest.approx(0, abs=1e-5)
    before = solved * 1e-3
    before[:2] += random.normal(size=before[:2].shape)  # frames that nobody learns from
    assert parts(before) == pytest.approx(1, abs=1e-5)


def assert_close(one: dict, other: dict) -> None:
    for name, array in one.items():
        np.testing.assert_allclose(array, other[name], atol=2e-3 * np.abs(other[name]).max())


def test_a_column_that_the_first_case_lacks_is_in_the_table(monkeypatch, capsys):
    """A clip of under 70 frames has no floor, the longer ones after it do; what is not known counts in no mean."""
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "benchmarks")
    short, unmoved = (
        {"kind": kind, "style": "bob", "network motion": error} for kind, error in (("a", 0.4), ("b", np.nan))
    )
    rows = [short, unmoved, {"kind": "c", "style": "bob", "network motion": 0.2, "floor motion": 0.1}]
    import_module("quality").table(rows, "style")
    heading, _, bob, every = capsys.readouterr().out.strip().splitlines()
    assert heading == "| style | network motion | floor motion |"
    assert bob == "| bob | 0.3 | 0.1 |" and every == "| all | 0.3 | 0.1 |"


def test_models_of_one_name_are_compared_under_their_paths(monkeypatch, tmp_path, capsys):
    """None is measured in another's place; without a body there is nothing to compare."""
    pytest.importorskip("torch", reason="the extra 'train' is not installed")
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "benchmarks")
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)
    rig_quality, still = import_module("rig_quality"), EXAMPLE / "quasi_static.neuralocks"
    paths = [still, *(tmp_path / folder / "hair.neuralocks" for folder in "ab")]
    for path in paths[1:]:
        path.parent.mkdir()
        path.write_bytes(still.read_bytes())
    seen = []

    def stop(rig, material, models):
        seen.extend(models)
        raise KeyboardInterrupt

    monkeypatch.setattr(rig_quality, "static_report", lambda *_, **__: {})
    monkeypatch.setattr(rig_quality, "motion_report", stop)
    monkeypatch.setattr(sys, "argv", ["rig_quality", *map(str, paths)])
    with pytest.raises(KeyboardInterrupt):
        rig_quality.main()
    assert seen == ["quasi_static", *map(str, paths[1:])]
    bare = small_shot(tmp_path / "bare.usda")
    monkeypatch.setattr(sys, "argv", [*sys.argv, "--character", str(bare)])
    with pytest.raises(NeuralocksError, match="bare.usda: no mesh of its hair can meet a body"):
        rig_quality.main()
