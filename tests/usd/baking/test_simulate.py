# SPDX-License-Identifier: Apache-2.0
"""The reference solver writes the same kind of layer as a bake."""

import json

import numpy as np
import pytest

from neuralocks_core.deformation.resolve import Resolver
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.evaluation.comparison import simulated
from neuralocks_core.strands.strand_set import strands_on
from usd.baking.join import join
from usd.baking.simulate import simulate
from usd.review.baked import read_baked
from usd.review.evaluate import evaluate
from usd.review.inspect import inspect

from ..commands import status
from ..shots import Recipe, samples, world_points, write_loop, write_shot

pytest.importorskip("warp", reason="the extra 'train' is not installed")


def test_simulated_hair_starts_at_rest_moves_and_keeps_its_length(tmp_path):
    shot = write_shot(tmp_path, Recipe(unit=0.01, up="Z", strands=12, bound="mesh"))
    result = simulate(shot, tmp_path / "out.usdc", strands=12)
    first = world_points(result.path, 1.0)
    assert np.abs(first - world_points(shot, 1.0)).max() < 1e-3
    last = world_points(result.path, 9.0).reshape(12, 12, 3)
    lengths = [np.linalg.norm(np.diff(p.reshape(12, 12, 3), axis=1), axis=-1).sum(1) for p in (first, last)]
    assert np.abs(lengths[1] / lengths[0] - 1).max() < 0.05
    assert np.abs(samples(result.path, "velocities", at=5.0)).max() > 1


def test_what_follows_simulated_hair_is_kept_out_of_the_body(tmp_path, monkeypatch):
    """And simulated strands stay as the solver has them. A report card covers both."""
    shot, points, cards = write_shot(tmp_path, Recipe(strands=160, vertices=24, frames=10)), [], []
    for name in ("free", "kept"):
        if name == "free":
            monkeypatch.setattr(Resolver, "apply", lambda *args: None)
        out = simulate(shot, tmp_path / f"{name}.usdc", strands=20).path
        monkeypatch.undo()
        points.append(samples(out, "points", at=10.0).reshape(160, 24, 3))
        cards.append(evaluate(out).grooms["/Hero/Hair"])
    item = read_baked(out).shot.grooms[0]
    every = strands_on(item.attachment.character, item.groom)
    chosen = every.whole_locks(20)
    assert (points[0][chosen] == points[1][chosen]).all() and (points[0] != points[1]).any()
    free, kept = (card["penetration_3mm_percent"] for card in cards)
    assert kept < 0.1 * free > 0.05
    monkeypatch.setattr("usd.review.subject.STRANDS", 20)
    few = evaluate(tmp_path / "free.usdc").grooms["/Hero/Hair"]
    assert few["measured"] == 20 and few["penetration_3mm_percent"] > 0.3 * free


def test_what_would_take_for_ever_or_means_nothing_is_refused(tmp_path):
    """Frames far from the animation, where the solver starts, would end in a traceback or exhaust the memory."""
    shot = write_shot(tmp_path)
    for wrong, said in (
        ({"frames": "1e308:1e308"}, "10000 are the most"),
        ({"frames": "9000000:9000001"}, "10000 are the most"),
        ({"volume": 1e308}, "--volume 1e\\+308: must be a number from 0 to 100"),
        ({"strands": 0}, "--strands 0: must be a whole number from 1 on"),
        ({"strands": "40"}, "--strands '40': must be"),
        ({"loop": "false"}, "--loop 'false': must be True or False"),
        ({"joints": {"nose": "head"}}, "--joint nose=...: there is no such meaning"),
        ({"xpbd": 0}, "--xpbd 0: must be a whole number from 1 to 500"),
        ({"xpbd": 2.5}, "--xpbd 2.5: must be a whole number"),
        ({"xpbd": True}, "--xpbd True: must be a whole number"),
        ({"xpbd": 501}, "--xpbd 501: must be a whole number from 1 to 500"),
        ({"xpbd": 20, "volume": 0.3}, "--volume 0.3: XPBD keeps no strands apart; leave out"),
        ({"device": "tpu"}, "--device tpu: is none; write cpu, cuda or cuda:N"),
        ({"device": None}, "--device None: is none"),
        ({"device": "cuda:99"}, "device cuda:99: not found by warp; use cpu"),
    ):
        with pytest.raises(NeuralocksError, match=said):
            simulate(shot, tmp_path / "slow.usdc", **wrong)
    assert [path.name for path in tmp_path.iterdir()] == [shot.name]


def test_simulation_begins_with_the_animation_whatever_frames_are_wanted(tmp_path):
    """So parts of a range equal the whole; before the animation, hair is at rest."""
    shot = write_shot(tmp_path, Recipe(strands=6))
    early, late = (
        simulate(shot, tmp_path / f"{name}.usdc", strands=6, frames=frames).path
        for name, frames in (("early", "-3:5"), ("late", "4:5"))
    )
    assert samples(early, "points", at=5).tobytes() == samples(late, "points", at=5).tobytes()
    assert samples(early, "points", at=-3).tobytes() == samples(early, "points", at=1).tobytes()
    before = simulate(shot, tmp_path / "before.usdc", strands=1, frames="-3:-2")
    assert any("none of it within -3 to -2" in note for note in before.notes)


def test_a_loop_ends_as_it_begins(tmp_path):
    """And its frames are the same, whichever are asked for."""
    shot = write_loop(tmp_path)
    whole, part = (
        simulate(shot, tmp_path / f"{name}.usdc", strands=6, loop=True, frames=frames).path
        for name, frames in (("whole", None), ("part", "7:12"))
    )
    first, last, middle = (world_points(whole, code) for code in (1.0, 13.0, 7.0))
    assert np.abs(first - last).max() < 1e-3 < np.abs(first - middle).max()
    assert np.abs(first - world_points(shot, 1.0)).max() > 5e-3
    assert samples(whole, "points", at=7).tobytes() == samples(part, "points", at=7).tobytes()
    assert inspect(whole)["grooms"][0]["baked with"]["loop"] is True
    with pytest.raises(NeuralocksError, match="--cuts: a loop has none"):
        simulate(shot, tmp_path / "cut.usdc", loop=True, cuts=[5])


def test_xpbd_moves_hair_as_the_solver_does_and_keeps_its_length(tmp_path):
    """The more substeps, the nearer; the bake undoes the stretch that few substeps leave."""
    shot = write_shot(tmp_path, Recipe(strands=12, vertices=24, frames=24))
    error = []
    for substeps in (4, 50):
        out = simulate(shot, tmp_path / "out.usdc", xpbd=substeps, material={"clumping": 0}).path
        made = inspect(out)["grooms"][0]["baked with"]
        assert made["solver"] == "xpbd" and made["substeps"] == substeps
        card = evaluate(out, reference=True)
        error.append(card.compared["/Hero/Hair"]["bake"]["motion_error_median"])
        assert card.grooms["/Hero/Hair"]["stretch_percent_max"] < 1e-3
        assert card.compared["/Hero/Hair"]["bake"]["motion_ratio"] > 0.5
    assert error[1] < 0.5 * error[0]


def test_the_command_line_simulates_as_python_does(tmp_path, capsys):
    """And tells what the implicit solver left unsolved, which XPBD does not know."""
    shot = write_shot(tmp_path, Recipe(strands=6, frames=6))
    bakes = []
    for words, options in (((), {}), (("--xpbd", 10, "--device", "cpu"), {"xpbd": 10, "device": "cpu"})):
        result = simulate(shot, tmp_path / "called.usdc", **options)
        assert status("simulate", shot, "-o", tmp_path / "typed.usdc", *words) == 0
        bakes.append((tmp_path / "typed.usdc").read_bytes())
        said = capsys.readouterr().out
        assert bakes[-1] == result.path.read_bytes()
        assert status("simulate", shot, "-o", tmp_path / "typed.usdc", *words, "--json") == 0
        told = json.loads(capsys.readouterr().out)
        if options:
            assert result.residual is None and "residual" not in told and "residual" not in said
        else:
            assert 0 < result.residual["median"] <= result.residual["worst"] < 1e-2 and result.residual["steps"] >= 6
            assert told["residual"] == result.residual
            median, worst = (f"{result.residual[name]:.2g}" for name in ("median", "worst"))
            left = f"{median} in the median of {result.residual['steps']} steps, {worst} in the worst\n"
            assert said.count(left) == 1
    assert bakes[0] != bakes[1]


def test_bakes_of_different_solvers_are_not_mixed(tmp_path):
    """Neither joined nor continued by each other."""
    shot = write_shot(tmp_path, Recipe(strands=6, frames=6))
    parts = {
        name: simulate(shot, tmp_path / f"{name}.usdc", strands=6, frames=frames, xpbd=xpbd).path
        for name, frames, xpbd in (("rods", "1:3", None), ("ten", "4:6", 10), ("five", "1:3", 5), ("begun", "1:3", 10))
    }
    with pytest.raises(NeuralocksError, match="was baked with different solver, substeps than in"):
        join([parts["rods"], parts["ten"]], tmp_path / "joined.usdc")
    with pytest.raises(NeuralocksError, match="was baked with different substeps than in"):
        join([parts["five"], parts["ten"]], tmp_path / "joined.usdc")
    join([parts["begun"], parts["ten"]], tmp_path / "joined.usdc")
    whole = simulate(shot, tmp_path / "whole.usdc", strands=6, xpbd=10).path
    assert (tmp_path / "joined.usdc").read_bytes() == whole.read_bytes()

    def stop(done, total, message):
        if done == 4 and message.startswith("/"):
            raise KeyboardInterrupt

    for again, taken in ({"xpbd": None}, False), ({"xpbd": 5}, False), ({"xpbd": 10}, True):
        with pytest.raises(KeyboardInterrupt):
            simulate(shot, tmp_path / "out.usdc", strands=6, xpbd=10, progress=stop)
        assert (simulate(shot, tmp_path / "out.usdc", strands=6, **again).resumed > 0) == taken
    assert (tmp_path / "out.usdc").read_bytes() == whole.read_bytes()


def test_clumping_that_does_nothing_is_told(tmp_path):
    shot = write_shot(tmp_path, Recipe(strands=6, frames=3))
    for options, told in (({}, 0), ({"xpbd": 5}, 1)):
        notes = simulate(shot, tmp_path / "out.usdc", material={"clumping": "2x"}, **options).notes
        assert sum("the material's clumping does nothing" in note for note in notes) == told
    assert not any("clumping" in note for note in simulate(shot, tmp_path / "out.usdc", xpbd=5).notes)


def test_a_gpu_is_told_to_the_solver_and_recorded(tmp_path, monkeypatch):
    """It rounds otherwise than a CPU, so that its bakes are not joined with a CPU's."""
    shot, devices = write_shot(tmp_path, Recipe(strands=6, frames=6)), []

    def here(*args, device, **options):
        devices.append(device)
        return simulated(*args, **options)

    monkeypatch.setattr("usd.baking.simulate.start_warp", lambda device: None)
    monkeypatch.setattr("usd.baking.simulate.simulated", here)
    parts = [
        simulate(shot, tmp_path / f"{number}.usdc", strands=6, frames=frames, device=device).path
        for number, (frames, device) in enumerate((("1:2", "cuda:0"), ("3:4", "cuda:1"), ("5:6", "cpu")))
    ]
    assert devices == ["cuda:0", "cuda:1", "cpu"]
    join(parts[:2], tmp_path / "joined.usdc")
    with pytest.raises(NeuralocksError, match="was baked with different device than in"):
        join(parts, tmp_path / "joined.usdc")
    made = [inspect(part)["grooms"][0]["baked with"] for part in parts]
    assert [told.get("device") for told in made] == ["cuda", "cuda", None]
