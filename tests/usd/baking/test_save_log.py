# SPDX-License-Identifier: Apache-2.0
"""A crate file goes back to one of its saves, whatever a kill or a power cut left of it, and goes on to the same bytes."""

import json
import zlib

import numpy as np
import pytest
from pxr import Sdf, Vt

from usd.baking.layer import sample_layer, save_log
from usd.baking.layer.sample_layer import SampleLayer
from usd.baking.layer.save_log import HEADER, SaveLog, spent_frames

HAIR, SPENT = Sdf.Path("/Hair"), range(1, 13)


@pytest.fixture(autouse=True)
def often(monkeypatch):
    monkeypatch.setattr(sample_layer, "SAVE_EVERY", 2 * 12 * 3000)


def log_in(folder, plan="plan"):
    return SaveLog(folder / "saves", plan, SPENT)


def written(folder, log=None, puts=0, until=12, name="layer.usdc"):
    """A layer of twelve samples, or as far as it is written."""
    file = SampleLayer(folder / name, folder / "out.usdc", log, puts)
    if not puts:
        Sdf.AttributeSpec(Sdf.CreatePrimInLayer(file.layer, HAIR), "points", Sdf.ValueTypeNames.Point3fArray)
    for number in range(puts, until):
        points = np.random.default_rng(number).normal(size=(3000, 3)).astype(np.float32)
        file.put(HAIR, number, {"points": Vt.Vec3fArray.FromNumpy(points)})
    if until == 12:
        file.close()
    return folder / name


@pytest.mark.parametrize(("lost", "puts"), [(0, 8), (40, 8), (2000, 6), (80_000, 4), (270_000, 0)])
def test_a_save_that_was_cut_off_is_taken_back(tmp_path, lost, puts):
    """Whatever is lost at the end of the file, with the header of a save that is not there, and one line half written."""
    whole = written(tmp_path, name="whole.usdc").read_bytes()
    part = written(tmp_path, log_in(tmp_path), until=8)
    with open(part, "r+b") as file:
        file.truncate(part.stat().st_size - lost)
        file.seek(16)
        file.write(bytes(8))
    with open(tmp_path / "saves", "a") as file:
        file.write("0123abcd {")
    assert log_in(tmp_path).restore(part) == puts
    log = log_in(tmp_path)
    assert log.restore(part) == puts and (not puts or spent_frames(tmp_path / "saves") == puts)
    # USD knows a layer by its path for as long as anything holds it.
    moved = part.rename(tmp_path / "moved.usdc")
    assert written(tmp_path, log, puts, name=moved.name).read_bytes() == whole


def test_a_page_that_a_power_cut_took_is_missed(tmp_path):
    part = written(tmp_path, log_in(tmp_path), until=10)
    with open(part, "r+b") as file:
        file.seek(25 * 4096)  # the second save's: 72,000 bytes each
        file.write(bytes(4096))
    assert log_in(tmp_path).restore(part) == 2


def test_a_page_that_begins_with_zeros_is_missed(tmp_path):
    """Like velocities of hair if some of it stands still."""
    file = tmp_path / "values"
    values = np.ones(9000, np.uint64)
    values[::512] = 0
    file.write_bytes(values.tobytes())
    before = save_log._trace(file, HEADER, 71_997)
    for lost in (1, 3, 17):
        changed = values.copy()
        changed[512 * lost : 512 * (lost + 1)] = 0
        file.write_bytes(changed.tobytes())
        assert save_log._trace(file, HEADER, 71_997) != before
    file.write_bytes(bytes(HEADER) + values.tobytes()[HEADER:])  # the header differs after the next save
    assert save_log._trace(file, HEADER, 71_997) == before


def test_a_page_that_fell_back_to_the_save_before_is_missed(tmp_path):
    """Values begin in the middle of a page that was already on the disk."""
    early = written(tmp_path, until=2, name="early.usdc").read_bytes()
    part = written(tmp_path, log_in(tmp_path), until=8)
    begin = json.loads((tmp_path / "saves").read_text().splitlines()[2][9:])["begin"]
    end = -(-begin // 4096) * 4096
    assert begin < end and len(early) > begin
    with open(part, "r+b") as file:
        file.seek(begin)
        file.write(early[begin:end])
    assert log_in(tmp_path).restore(part) == 2


@pytest.mark.parametrize("harm", ["lost", "changed"])
def test_a_log_counts_up_to_the_first_line_that_is_not_as_it_was(tmp_path, harm):
    part, log = written(tmp_path, log_in(tmp_path), until=8), tmp_path / "saves"
    lines = log.read_text().splitlines(keepends=True)
    lines[2:3] = [lines[2].replace('"puts": 4', '"puts": 5')] if harm == "changed" else []
    log.write_text("".join(lines))
    assert log_in(tmp_path).restore(part) == 2


def test_a_file_with_all_its_samples_is_closed_as_it_is(tmp_path):
    whole = written(tmp_path, log_in(tmp_path))
    log, bytes_ = log_in(tmp_path), whole.read_bytes()
    assert log.restore(whole) == 12
    moved = whole.rename(tmp_path / "moved.usdc")
    assert written(tmp_path, log, 12, name=moved.name).read_bytes() == bytes_


@pytest.mark.parametrize("harm", ["another plan", "no log", "garbage", "a huge place"])
def test_a_log_of_something_else_counts_for_nothing(tmp_path, harm):
    part = written(tmp_path, log_in(tmp_path), until=6)
    before, log = part.read_bytes(), tmp_path / "saves"
    if harm == "no log":
        log.unlink()
    elif harm == "garbage":
        log.write_bytes(bytes(range(256)) * 9)
    elif harm == "a huge place":
        lines = log.read_text().splitlines()
        lines[1:] = [_signed(line[9:].replace('"end": ', '"end": 9999')) for line in lines[1:]]
        log.write_text("\n".join(lines) + "\n")
    assert log_in(tmp_path, "other" if harm == "another plan" else "plan").restore(part) == 0
    assert part.read_bytes() == before


def _signed(text):
    return f"{zlib.crc32(text.encode()):08x} {text}"


def test_a_hard_link_in_the_place_of_a_log_is_let_go_of(tmp_path):
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "saves").hardlink_to(tmp_path / "mine")
    written(tmp_path, log_in(tmp_path), until=4)
    assert (tmp_path / "mine").read_text() == "mine" and spent_frames(tmp_path / "saves") == 4
