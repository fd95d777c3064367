# SPDX-License-Identifier: Apache-2.0
"""The reference solver writes the same kind of layer as a bake."""

import numpy as np
import pytest

from neuralocks_core.deformation.resolve import Resolver
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.strands.strand_set import strands_on
from usd.baking.simulate import simulate
from usd.review.baked import read_baked
from usd.review.evaluate import evaluate
from usd.review.inspect import inspect

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
    shot, points, cards = write_shot(tmp_path, Recipe(strands=160, vertices=24, frames=20)), [], []
    for name in ("free", "kept"):
        if name == "free":
            monkeypatch.setattr(Resolver, "apply", lambda *args: None)
        out = simulate(shot, tmp_path / f"{name}.usdc", strands=20).path
        monkeypatch.undo()
        points.append(samples(out, "points", at=16.0).reshape(160, 24, 3))
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
