# SPDX-License-Identifier: Apache-2.0
"""The one-file model: what is written comes back, and what is no model is refused in one line."""

import json
import os
import random
import re
import struct
import tracemalloc
import zipfile

import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models import model_file
from tests.strand_models import rewritten

PATH = model_file.shipped("strands")


def test_what_a_model_does_not_say_of_itself_is_empty(tmp_path):
    file = model_file.read(PATH)
    quiet = model_file.write(
        tmp_path / "quiet.neuralocks", {**file.meta, "training": None, "credits": None}, file.graphs
    )
    assert [model_file.read(quiet).meta[name] for name in ("training", "credits")] == [{}, []]


def test_what_nobody_could_show_is_refused(tmp_path):
    file = model_file.read(PATH)
    deep, card = [], {}
    for _ in range(300):
        deep = [deep]
    for _ in range(100):  # as many trainings, each going on from the one before
        card = {"began with": card}
    with pytest.raises(
        NeuralocksError, match="deep.neuralocks: its 'report' is not a table of values; get an undamaged"
    ):
        model_file.read(
            model_file.write(tmp_path / "deep.neuralocks", file.meta | {"report": {"rows": deep}}, file.graphs)
        )
    assert (
        model_file.read(
            model_file.write(tmp_path / "long.neuralocks", file.meta | {"training": card}, file.graphs)
        ).meta["training"]
        == card
    )
    for name in ("kind", "format"):
        meta = json.dumps(file.meta | {name: "x" * 3000 if name == "kind" else 10**3000}).encode()
        with pytest.raises(NeuralocksError, match="odd.neuralocks: .*; update neuralocks") as caught:
            model_file.read(rewritten(PATH, tmp_path / "odd.neuralocks", model_json=meta))
        assert len(str(caught.value)) < len(str(tmp_path)) + 200


def test_truncated_missing_and_foreign_files_are_refused(tmp_path):
    cut = tmp_path / "cut.neuralocks"
    cut.write_bytes(PATH.read_bytes()[:-500])
    for file in (cut, tmp_path / "missing.neuralocks", tmp_path):
        with pytest.raises(NeuralocksError):
            model_file.read(file)
    with pytest.raises(NeuralocksError, match="strand hair, not for rigged"):
        model_file.read(PATH, "rig")
    with pytest.raises(NeuralocksError, match=f"^{re.escape(os.devnull)}: (is not a file|no such)"):
        model_file.read(os.devnull)
    with open(cut, "ab") as file:
        file.truncate(1 << 30)
    with pytest.raises(NeuralocksError, match="more than a model has"):
        model_file.read(cut)


def test_what_unpacks_to_more_than_a_model_is_not_unpacked(tmp_path):
    bomb = rewritten(PATH, tmp_path / "bomb.neuralocks", tail_onnx=None)
    with zipfile.ZipFile(bomb, "a", zipfile.ZIP_DEFLATED) as archive, archive.open("tail.onnx", "w") as entry:
        for _ in range(65):
            entry.write(bytes(1 << 20))
    assert bomb.stat().st_size < 10 << 20
    with pytest.raises(NeuralocksError, match=r"tail.onnx claims 68157440 bytes, more than a model has; get another"):
        model_file.read(bomb)


def test_what_unpacks_to_more_than_it_claims_is_unpacked_as_far_as_that(tmp_path):
    bomb, size = tmp_path / "bomb.neuralocks", 200 << 20
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("model.json", "w") as entry:
        for _ in range(size >> 20):
            entry.write(bytes(1 << 20))
    bomb.write_bytes(bomb.read_bytes().replace(struct.pack("<I", size), struct.pack("<I", 1000)))
    tracemalloc.start()
    try:
        with pytest.raises(NeuralocksError, match="bomb.neuralocks: damaged or not a model"):
            model_file.read(bomb)
        assert tracemalloc.get_traced_memory()[1] < 20 << 20
    finally:
        tracemalloc.stop()


def test_of_a_file_that_is_no_model_by_its_name_either_another_is_asked_for(tmp_path):
    """A shot in place of a model, such as `export shot.usda`, is not a damaged one of which there is a better copy."""
    (tmp_path / "shot.usda").write_text("#usda 1.0")
    with pytest.raises(NeuralocksError, match=r"shot.usda: it is not a neuralocks model .*; choose a .neuralocks file"):
        model_file.read(tmp_path / "shot.usda")


@pytest.mark.parametrize("packed", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_damage_is_told_in_one_line_however_a_file_is_packed(tmp_path, packed):
    """Each way to pack entries has its own errors."""
    with zipfile.ZipFile(PATH) as old, zipfile.ZipFile(tmp_path / "m.neuralocks", "w", packed) as new:
        for name in old.namelist():
            new.writestr(name, old.read(name))
    whole, chance, refused = (tmp_path / "m.neuralocks").read_bytes(), random.Random(0), 0
    for _ in range(30):
        damaged = bytearray(whole)
        damaged[chance.randrange(50, 3000)] ^= 1 << chance.randrange(8)
        (tmp_path / "m.neuralocks").write_bytes(damaged)
        try:
            model_file.read(tmp_path / "m.neuralocks")
        except NeuralocksError as error:
            refused += 1
            assert "\n" not in str(error) and str(error).startswith(f"{tmp_path / 'm.neuralocks'}: ")
    assert refused > 25


def test_writing_twice_gives_the_same_bytes(tmp_path):
    file = model_file.read(PATH)
    copies = [model_file.write(tmp_path / f"{i}.neuralocks", file.meta, file.graphs).read_bytes() for i in (1, 2)]
    assert copies[0] == copies[1]
    with pytest.raises(NeuralocksError, match="3.neuralocks: .* NaN .* --set rate"):
        model_file.write(tmp_path / "3.neuralocks", {**file.meta, "report": {"loss": float("nan")}}, file.graphs)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["1.neuralocks", "2.neuralocks"]
