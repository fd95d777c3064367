# SPDX-License-Identifier: Apache-2.0
"""Writing samples: only shot, model and time matter, and kills leave no trace."""

import importlib.util
import signal
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pxr import Sdf

from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.baking.layer.spool import kept
from usd.baking.simulate import simulate
from usd.cli.app import main
from usd.shot.stage import read_shot

from ...full_disk import room_for
from ..shots import Recipe, samples, write_shot

ROOT = Path(__file__).parents[3]


def test_order_chunks_and_jobs_give_the_same_bytes(tmp_path, model):
    shot = write_shot(tmp_path, Recipe(strands=1500, vertices=9))
    whole = bake(shot, tmp_path / "bake.usdc", model, jobs=2, subframes=2).path.read_bytes()
    again = bake(shot, tmp_path / "bake.usdc", model, jobs=1, subframes=2).path.read_bytes()
    codes = [t + s for t in range(1, 10) for s in (0, 0.5)]
    np.random.default_rng(0).shuffle(codes)
    shuffled = bake(shot, tmp_path / "bake.usdc", model, frames=codes).path.read_bytes()
    assert whole == again == shuffled
    part = bake(shot, tmp_path / "part.usdc", model, frames="4:6")
    for code in (4.0, 5.0, 6.0):
        one, other = (
            samples(p, "points", "velocities", "extent", at=code) for p in (tmp_path / "bake.usdc", part.path)
        )
        assert [a.tobytes() for a in one] == [a.tobytes() for a in other]


def test_large_grooms_are_written_in_blocks_that_leave_no_trace(tmp_path, model, monkeypatch):
    shot = write_shot(tmp_path, Recipe(strands=60, vertices=9))
    whole = bake(shot, tmp_path / "bake.usdc", model).path.read_bytes()
    monkeypatch.setattr("usd.baking.samples.BLOCK", 100)
    assert bake(shot, tmp_path / "bake.usdc", model).path.read_bytes() == whole


def test_a_killed_bake_leaves_nothing_and_goes_on(tmp_path, model):
    shot, out = write_shot(tmp_path), tmp_path / "bake.usdc"
    whole = bake(shot, out, model).path.read_bytes()
    out.unlink()
    spool = tmp_path / ".bake.usdc.baking"
    code = f"""import os, signal
from pathlib import Path
from usd.baking.bake import bake
def killed(*_):
    if len(list(Path({str(spool)!r}).glob("*.frame"))) >= 3:
        os.kill(os.getpid(), signal.SIGKILL)
bake({str(shot)!r}, {str(out)!r}, {str(model)!r}, progress=killed)"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT)
    assert done.returncode == -signal.SIGKILL and not out.exists() and spool.exists()
    result = bake(shot, out, model)
    assert result.resumed >= 3
    assert out.read_bytes() == whole
    assert {p.name for p in tmp_path.iterdir()} == {"shot.usda", "bake.usdc"}


@pytest.mark.parametrize("beards", [0, 1])
def test_a_bake_stopped_anywhere_goes_on_to_the_same_bytes(tmp_path, model, monkeypatch, beards):
    """Also if stopped twice, and if grooms are posed together; a frame stays only as long as something needs it."""
    shot, out = write_shot(tmp_path, Recipe(frames=14, strands=60)), tmp_path / "bake.usdc"
    layer = Sdf.Layer.FindOrOpen(str(shot))
    for number in range(beards):
        Sdf.CopySpec(layer, "/Hero/Hair", layer, f"/Hero/Beard{number}")
    layer.Save()
    monkeypatch.setattr("usd.baking.layer.sample_layer.SAVE_EVERY", 3 * 60 * 12 * 12)
    whole, frames, most = bake(shot, out, model).path.read_bytes(), 14 * (1 + beards), 0
    out.unlink()

    def until(last):
        def stop(done, total, message):
            nonlocal most
            most = max(most, len(list(tmp_path.glob(".bake.usdc.baking/*.frame"))))
            if done >= last:
                raise KeyboardInterrupt

        return stop

    for stops in ([1], [5], [9, 12], [13, 14], [frames]):
        for last in stops:
            with pytest.raises(KeyboardInterrupt):
                bake(shot, out, model, progress=until(last))
            posed = min(-(-last // (1 + beards)), 14)
            assert abs(kept(out) - posed) <= 2
        (layer,) = tmp_path.glob(".bake.usdc.baking/*.part.usdc")
        aside = layer.rename(tmp_path / "aside")
        assert kept(out) == len(list(tmp_path.glob(".bake.usdc.baking/*.frame"))), "what was in the layer is gone"
        aside.rename(layer)
        assert bake(shot, out, model).resumed >= (1 + beards) * (posed - 1)
        assert out.read_bytes() == whole
        out.unlink()
        assert [path.name for path in tmp_path.iterdir()] == ["shot.usda"]
    assert most <= (14 if beards else 9)


def test_a_layer_that_no_log_can_be_kept_of_is_written_all_the_same(tmp_path, model, monkeypatch):
    """As could be with a later USD: a stopped bake then resumes from its frames, all of which stay."""
    shot, out = write_shot(tmp_path), tmp_path / "bake.usdc"
    monkeypatch.setattr("usd.baking.layer.sample_layer.SAVE_EVERY", 1)
    whole = bake(shot, out, model).path.read_bytes()
    out.unlink()

    def unknown(file):
        raise ValueError("of another kind")

    def stop(done, total, message):
        if done == 7:
            raise KeyboardInterrupt

    monkeypatch.setattr("usd.baking.layer.save_log._tables", unknown)
    with pytest.raises(KeyboardInterrupt):
        bake(shot, out, model, progress=stop)
    assert bake(shot, out, model).resumed >= 6 and out.read_bytes() == whole


@pytest.mark.parametrize("frames", ["1:9", "1:5"])
def test_a_stopped_bake_begins_anew_for_other_frames(tmp_path, model, monkeypatch, frames):
    """Also for the same number of frames; then what was saved of it is gone."""
    shot, out = write_shot(tmp_path), tmp_path / "bake.usdc"
    monkeypatch.setattr("usd.baking.layer.sample_layer.SAVE_EVERY", 1)
    whole = bake(shot, out, model, frames="2:6").path.read_bytes()

    def stop(done, total, message):
        if done == 5:
            raise KeyboardInterrupt

    def look(done, total, message):
        assert len(list(tmp_path.glob(".bake.usdc.baking/*.usdc"))) == 1

    with pytest.raises(KeyboardInterrupt):
        bake(shot, out, model, frames=frames, progress=stop)
    assert bake(shot, out, model, frames="2:6", progress=look).resumed < 5
    assert out.read_bytes() == whole


@pytest.mark.parametrize("changed", [{"folder": "a/deeper"}, {"cuts": []}, {"joints": {"head": "head"}}])
def test_a_stopped_bake_goes_on_to_a_file_that_tells_how_it_was_made_now(tmp_path, model, monkeypatch, changed):
    """If the folder was moved, or recorded options that change no sample differ: a layer that finds no shot is worthless."""
    shot, first = write_shot(tmp_path), tmp_path / "one" / "bake.usdc"
    last = tmp_path / changed.pop("folder", "one") / first.name
    monkeypatch.setattr("usd.baking.layer.sample_layer.SAVE_EVERY", 1)

    def stop(done, total, message):
        if done == 7:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bake(shot, first, model, progress=stop)
    last.parent.parent.mkdir(exist_ok=True)
    first.parent.rename(last.parent)
    resumed = bake(shot, last, model, **changed).path.read_bytes()
    assert bake(shot, last, model, **changed).path.read_bytes() == resumed


def test_ctrl_c_tells_that_the_same_command_goes_on(tmp_path, model):
    shot, out = write_shot(tmp_path), tmp_path / "bake.usdc"
    code = """import os, signal
from usd.__main__ import main
from usd.baking.layer.spool import Spool, kept
signal.signal(signal.SIGINT, signal.default_int_handler)
write = Spool.write
def pressed(spool, *frame):
    write(spool, *frame)
    if kept(spool.out) == 3:
        os.kill(os.getpid(), signal.SIGINT)
Spool.write = pressed
main()"""
    words = ["bake", str(shot), "-o", str(out), "--model", str(model)]
    done = subprocess.run([sys.executable, "-c", code, *words], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 130 and not out.exists() and kept(out) == 3
    assert done.stderr.endswith("note: the same command continues from here, with 3 samples done\nstopped\n")


@pytest.mark.parametrize("save_every", [1, 1 << 30])
def test_a_disk_that_fills_up_leaves_finished_frames_to_go_on_from(tmp_path, model, monkeypatch, capsys, save_every):
    shot, out = write_shot(tmp_path, Recipe(strands=500)), tmp_path / "bake.usdc"
    words = ["bake", str(shot), "-o", str(out), "--model", str(model)]
    monkeypatch.setattr("usd.baking.layer.sample_layer.SAVE_EVERY", save_every)
    whole = bake(shot, out, model).path.read_bytes()
    out.unlink()
    with pytest.raises(SystemExit) as ended, room_for(len(whole) // 2):
        main(words)
    assert ended.value.code == 1 and not out.exists()
    *_, note, error = capsys.readouterr().err.splitlines()
    done = kept(out)
    assert note == f"note: the same command continues from here, with {done} samples done" and done >= 3
    assert error.startswith(f"error: {out}: ") and "space" in error
    assert bake(shot, out, model).resumed >= done - 1
    assert out.read_bytes() == whole
    assert [path.name for path in tmp_path.iterdir()] == ["shot.usda", "bake.usdc"]


def test_frames_of_other_inputs_are_not_taken_over(tmp_path, model, still_model):
    shot, out = write_shot(tmp_path), tmp_path / "bake.usdc"

    def stop(done, total, message):
        if done == 4:
            raise KeyboardInterrupt

    for again, taken in ((model, 4), (still_model, 0)):
        with pytest.raises(KeyboardInterrupt):
            bake(shot, out, model, progress=stop)
        assert not out.exists()
        resumed = bake(shot, out, again).resumed
        assert abs(resumed - taken) <= 1 if taken else resumed == 0
        out.unlink()


def test_frames_of_another_version_of_the_program_are_not_taken_over(tmp_path, model, monkeypatch):
    shot, out, own = write_shot(tmp_path), tmp_path / "bake.usdc", tmp_path / "posing.py"

    def stop(done, total, message):
        if done == 4:
            raise KeyboardInterrupt

    own.write_text("one")
    monkeypatch.setattr("usd.baking.samples.program_files", lambda: [own])
    with pytest.raises(KeyboardInterrupt):
        bake(shot, out, model, progress=stop)
    own.write_text("another")
    assert bake(shot, out, model).resumed == 0


def test_frames_of_a_shot_read_otherwise_are_not_taken_over(tmp_path, model):
    """Neither by a bake nor by a simulation, whoever read the shot: from there on, hair would swing about another joint."""
    path, out = write_shot(tmp_path, Recipe(bound="none")), tmp_path / "bake.usdc"
    makers = [lambda shot, **options: bake(shot, out, model, **options)]
    if importlib.util.find_spec("warp"):
        makers.append(lambda shot, **options: simulate(shot, out, strands=4, **options))

    def stop(done, total, message):
        if done == 4 and message.startswith("/"):
            raise KeyboardInterrupt

    for make in makers:
        for other in ({"head": "neck"}, {"cuts": [3]}):
            for again, taken in (({}, 0), (other, 1)):
                with pytest.raises(KeyboardInterrupt):
                    make(path, **other, progress=stop)
                assert (make(read_shot(path, **again)).resumed > 0) == taken


def test_a_bake_as_text_asks_for_the_space_of_the_text_too(tmp_path, model, monkeypatch):
    """It was refused after the last frame."""
    shot = write_shot(tmp_path, Recipe(frames=10, strands=50, vertices=10))
    text = bake(shot, tmp_path / "text.usda", model, velocities=False).path.stat().st_size
    binary = 21 * 50 * 10 * 12  # the points of ten frames twice, and a little
    for room, refused in ((0.98, pytest.raises(NeuralocksError, match="MB while")), (1.2, nullcontext())):
        free = int(binary + room * text)
        monkeypatch.setattr("usd.baking.samples.shutil.disk_usage", lambda _, free=free: SimpleNamespace(free=free))
        with refused:
            bake(shot, tmp_path / "out.usda", model, velocities=False)


def test_a_bake_that_goes_on_asks_for_the_space_that_it_still_needs(tmp_path, model, monkeypatch):
    """Not counting left-over files beside the finished frames, which are gone by then; if it is refused, the frames stay."""
    shot, out = write_shot(tmp_path, Recipe(frames=10, strands=50, vertices=10)), tmp_path / "bake.usdc"
    layer = Sdf.Layer.FindOrOpen(str(shot))
    Sdf.CopySpec(layer, "/Hero/Hair", layer, "/Hero/Beard")
    layer.Save()
    spool, frame = tmp_path / ".bake.usdc.baking", 2 * 50 * 10 * 12
    disk = 21 * frame  # the points of ten frames twice, and a little

    def usage(_):
        return SimpleNamespace(free=disk - sum(file.stat().st_size for file in spool.glob("*")))

    def stop(done, total, message):
        if done == 16:
            raise KeyboardInterrupt

    monkeypatch.setattr("usd.baking.samples.shutil.disk_usage", usage)
    monkeypatch.setattr("usd.baking.samples.SAVE_EVERY", 1)
    with pytest.raises(KeyboardInterrupt):
        bake(shot, out, model, velocities=False, progress=stop)
    left = len(list(spool.glob("*.frame")))
    (spool / f"{0:032x}.part.usdc").write_bytes(bytes(5 * frame))
    disk = 19 * frame
    with pytest.raises(NeuralocksError, match="needs 1 MB while"):
        bake(shot, out, model, velocities=False)
    assert len(list(spool.glob("*.frame"))) == left >= 7
    (spool / f"{0:032x}.part.usdc").write_bytes(bytes(5 * frame))
    disk = 21 * frame
    assert bake(shot, out, model, velocities=False).resumed == 2 * left
