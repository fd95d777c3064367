# SPDX-License-Identifier: Apache-2.0
"""How far long work is: lines in a log, with the time left of each step; a bar on a terminal."""

import re
import sys
from types import SimpleNamespace

from usd.baking.bake import bake
from usd.baking.points.posing import GroomPoser
from usd.cli import progress

from ..shots import Recipe, write_shot


def test_a_log_tells_the_time_left_of_the_step_that_it_is_at(monkeypatch, capsys):
    clock = iter(range(0, 10_000, 30))
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    with progress.progress_bar("baking") as say:
        for done in (40, 50, 70):  # resumed at 40
            say(done, 100, f"frame {done}")
        say(0, 10, "writing")
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "baking: 40% frame 40"
    assert [float(re.search(r", ([\d.]+) min left", line)[1]) for line in lines[1:3]] == [2.5, 1.0]
    assert lines[3] == "baking: 0% writing"


def test_the_time_before_work_gets_going_is_not_taken_for_its_speed(monkeypatch, capsys):
    clock = iter(range(0, 10_000, 30))
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    with progress.progress_bar("training") as say:
        for done in (0, 0, 0, 0, 50):
            say(done, 100, "first simulations" if not done else "")
    assert ", 0.5 min left" in capsys.readouterr().err.splitlines()[-1]


def test_what_a_bake_prepares_is_not_taken_for_its_speed(tmp_path, model, monkeypatch, capsys):
    """A minute before the first frame, a second for each: the estimate is not hours."""
    clock, poser, points = [0.0], GroomPoser.__init__, GroomPoser.points

    def begun(*args, **options):
        clock[0] += 60
        poser(*args, **options)

    def posed(*args):
        clock[0] += 1
        return points(*args)

    monkeypatch.setattr(GroomPoser, "__init__", begun)
    monkeypatch.setattr(GroomPoser, "points", posed)
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    monkeypatch.setattr(progress, "LOG_EVERY", 0.5)
    shot = write_shot(tmp_path, Recipe(strands=4))
    with progress.progress_bar("baking") as say:
        bake(shot, tmp_path / "out.usdc", model, velocities=False, progress=say)
    left = re.findall(r"([\d.]+) min left", capsys.readouterr().err)
    assert len(left) == 9 and float(left[0]) == 0.1


def test_nothing_is_foretold_of_the_first_frame_alone(monkeypatch, capsys):
    clock = iter(range(0, 10_000, 30))
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    with progress.progress_bar("baking") as say:
        for done in (0, 1, 50):
            say(done, 241, "Hair")
    assert ["left" in line for line in capsys.readouterr().err.splitlines()] == [False, False, True]


def test_quick_work_shows_nothing_and_slow_work_on_a_terminal_a_bar(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with progress.progress_bar("baking") as say:
        say(1, 2, "frame 1")
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(progress, "QUIET_FOR", -1.0)
    with progress.progress_bar("baking") as say:
        say(1, 2, "frame 1")
        say(0, 3, "another step")
    assert "baking" in capsys.readouterr().err


def test_a_narrow_terminal_shows_share_and_time_left(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "30")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(progress, "QUIET_FOR", -1.0)
    with progress.progress_bar("baking") as say:
        say(1, 2, "a message that is long")
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", capsys.readouterr().err)
    assert re.search(r" 50 % +left -:--:-- ", plain)
