# SPDX-License-Identifier: Apache-2.0
"""The files of a shot's grooms for other runtimes; what they hold is tested with the example that reads them."""

import time

import numpy as np
import pytest

from neuralocks_core.models import model_file
from neuralocks_core.models.runtime import StrandModel
from usd.models.groom_tables import export_grooms, file_names, tables
from usd.shot.stage import read_shot

from ..shots import Recipe, write_shot


def test_the_size_of_a_head_is_the_same_in_any_unit(tmp_path, model):
    runner = StrandModel(model_file.read(model, "strands"))
    for unit in (1.0, 0.01):
        (groom,) = read_shot(write_shot(tmp_path, Recipe(unit=unit), f"{unit}")).grooms
        assert tables(groom, runner)[0]["size"] == pytest.approx(1)


def test_a_character_need_not_be_animated(tmp_path, model):
    """An engine animates it."""
    held = []
    for frames in (0, 9):
        shot = read_shot(write_shot(tmp_path, Recipe(frames=frames), f"{frames}"), still=True)
        told = export_grooms(
            shot.grooms, StrandModel.load(model), lambda name, frames=frames: tmp_path / f"{frames}_{name}"
        )
        held.append(dict(np.load(tmp_path / f"{frames}_{next(iter(told))}")))
    assert all(np.array_equal(held[0][name], held[1][name]) for name in held[1])


def test_no_disk_takes_two_grooms_files_for_one():
    paths = ["/World/Hair", "/World/hair", "/World_Hair", "/World_Hair_2", "/World/Brows"]
    assert file_names(paths)[::4] == ["World_Hair.npz", "World_Brows.npz"]
    assert len({name.lower() for name in file_names(paths)}) == len(paths)
    deep = [f"/{'A_group_of_groups/' * 20}{name}" for name in ("Hair", "Brows", "H\u00e4" * 90)]
    began = time.process_time()
    assert file_names(["/World/Hair"] * 500)[-1] == "World_Hair_500.npz" and time.process_time() - began < 1
    names = file_names([*deep, deep[0].replace("A_", "B_", 1)])
    assert len(set(names)) == 4 and max(len(name.encode()) for name in names) < 160
    assert names[0].endswith("_A_group_of_groups_Hair.npz") and names[1].endswith("_Brows.npz")
