# SPDX-License-Identifier: Apache-2.0
"""The header's history where an engine begins: before the first push, after a reset, as a copy, and beside that of another character."""

import numpy as np
import pytest

from neuralocks_core.rig import rig_spec
from neuralocks_core.rig.export_c import export_c
from tests.core.rig.builders import random_model
from tests.core.rig.c_programs import compiled, run_c

HARNESS = """#include "hair.h"
#include <stdio.h>
#include <string.h>
int main(void) {
  static nl_hair_history histories[2], copy;
  static float row[10], out[6 * NL_HAIR_BINS], again[6 * NL_HAIR_BINS];
  const float down[3] = {0.0f, -1.0f, 0.0f};
  memset(histories, 0x5a, sizeof histories); /* as on a heap */
  while (fread(row, sizeof row, 1, stdin) == 1) {
    nl_hair_history *own = histories + (int)row[8];
    if (row[9] > 0.0f) nl_hair_history_reset(own);
    if (row[9] < 2.0f) nl_hair_history_push(own, (double)row[0], row + 1, row + 4);
    copy = *own;
    nl_hair_history_read(&copy, down, again);
    nl_hair_history_read(own, down, out);
    if (memcmp(again, out, sizeof out) || memcmp(&copy, own, sizeof copy)) return 1;
    fwrite(out, sizeof out, 1, stdout);
  }
  return 0;
}
"""
PUSHED, RESET, ONLY_RESET = 0, 1, 2
COUNT = 6 * len(rig_spec(True).bins)


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """Reads rows of time, position, rotation, the number of a character and what is done to its history first."""
    folder = tmp_path_factory.mktemp("reset")
    export_c(random_model((2,), 8, spec=rig_spec(True)), folder / "hair.h")
    return compiled(folder, HARNESS)


def moved(count, seed=0, character=0):
    """Rows of a head that sways and turns, at 60 fps; its history is reset before the first."""
    t, rng = np.arange(count) / 60, np.random.default_rng(seed)
    rows = np.zeros((count, 10))
    rows[:, 0], rows[:, 1:4] = t, 0.1 * np.sin(np.outer(t, [5, 3, 7]) + rng.normal(size=3))
    angle = 0.5 * np.sin(4 * t + rng.normal())
    rows[:, 4], rows[:, 5:8] = np.cos(angle), np.sin(angle)[:, None] * [0.6, 0, 0.8]
    rows[:, 8], rows[0, 9] = character, RESET
    return rows


def test_nothing_is_felt_before_a_push(program):
    """Also if the first pushes are damaged ones, which do not count."""
    rows = moved(4)
    rows[0, 9] = ONLY_RESET
    rows[1, 1], rows[2, 6], rows[3, 0] = np.nan, np.inf, np.nan
    assert not run_c(program, rows, COUNT).any()


def test_a_head_that_never_moves_feels_nothing(program):
    """Gravity points down after a reset, whatever was in memory before."""
    rows = np.tile(moved(1), (100, 1))
    rows[:, 0], rows[1:, 9] = np.arange(100) / 60, PUSHED
    assert np.abs(run_c(program, rows, COUNT)).max() < 1e-5


def test_after_a_reset_nothing_of_before_is_felt(program):
    """After a few and after many pushes, to the bit if the clock starts again, and as nearly as its doubles allow if it goes on."""
    felt = run_c(program, moved(200, 1), COUNT)
    assert np.abs(felt[-1]).max() > 0.1
    for before in (1, 2, 300):
        for clock in (0.0, 7.0):
            rows = np.concatenate([moved(before, 2) + np.eye(10)[1] * 50, moved(200, 1)])
            rows[before:, 0] += clock
            later = run_c(program, rows, COUNT)[before:]
            np.testing.assert_allclose(later, felt, atol=1e-4 if clock else 0)


def test_a_push_at_an_earlier_or_at_the_same_time_is_ignored(program):
    """As of a clip's clock where it starts again: the head is elsewhere then, and comes back."""
    rows = moved(200)
    felt = run_c(program, rows, COUNT)
    for back in (0.0, 0.3, 100.0):
        extra = rows[100:101] + np.eye(10)[1] - back * np.eye(10)[0]
        later = run_c(program, np.concatenate([rows[:101], extra, rows[101:]]), COUNT)
        np.testing.assert_array_equal(np.delete(later, 101, axis=0), felt)
        np.testing.assert_array_equal(later[101], felt[100])


def test_histories_of_two_characters_know_nothing_of_each_other(program):
    alone = [run_c(program, moved(200, seed), COUNT) for seed in (1, 2)]
    together = np.stack([moved(200, 1, 0), moved(200, 2, 1)], axis=1).reshape(400, -1)
    np.testing.assert_array_equal(run_c(program, together, COUNT).reshape(200, 2, -1), np.stack(alone, axis=1))


def test_the_sign_and_the_length_of_a_rotation_mean_nothing(program):
    """An engine may flip the sign at any frame: q and -q are one rotation."""
    rows, rng = moved(200), np.random.default_rng(0)
    felt = run_c(program, rows, COUNT)
    rows[:, 4:8] *= rng.choice([-1, 1], (200, 1)) * np.exp(rng.uniform(np.log(0.002), np.log(2), (200, 1)))
    np.testing.assert_allclose(run_c(program, rows, COUNT), felt, atol=2e-3)
