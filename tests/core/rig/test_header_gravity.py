# SPDX-License-Identifier: Apache-2.0
"""What the header's history feels of gravity and wind: in the head's axes, wherever they point."""

import numpy as np
import pytest

from neuralocks_core.rig import rig_spec
from neuralocks_core.rig.export_c import export_c
from neuralocks_core.rotation import from_vector, to_quaternion
from tests.core.rig.builders import random_model
from tests.core.rig.c_programs import compiled, run_c

WALL_HARNESS = """#include "hair.h"
#include <stdio.h>
int main(void) {
  static nl_hair_history history;
  static float row[11], out[6 * NL_HAIR_BINS];
  int i;
  nl_hair_history_reset(&history);
  while (fread(row, sizeof row, 1, stdin) == 1) {
    for (i = 0; i < 3; ++i) history.down[i] = row[8 + i];
    nl_hair_history_push(&history, (double)row[0], row + 1, row + 4);
    nl_hair_history_read(&history, row + 8, out);
    fwrite(out, sizeof out, 1, stdout);
  }
  return 0;
}
"""


def test_gravity_may_point_anywhere(tmp_path):
    """Walking on a wall, a ceiling or around a planet feels like walking on the ground."""
    export_c(random_model(spec=rig_spec(True)), tmp_path / "hair.h")
    program = compiled(tmp_path, WALL_HARNESS)
    t = np.arange(0, 3, 1 / 60)
    turns = from_vector(np.outer(0.4 * np.sin(3 * t), [1, 0.3, 0.2]))
    places = np.stack([0.1 * np.sin(4 * t), 1.6 + 0 * t, t], axis=1)
    felt = []
    for whole in (np.eye(3), from_vector(np.array([np.pi / 2, 0, 0])), from_vector(np.array([0, 0.3, np.pi]))):
        down = np.tile(whole @ [0, -1, 0], (len(t), 1))
        rows = np.hstack([t[:, None], places @ whole.T, to_quaternion(whole @ turns), down])
        felt.append(run_c(program, rows, 6 * len(rig_spec(True).bins)))
    assert np.abs(felt[0]).max() > 0.5
    np.testing.assert_allclose(felt[1:], [felt[0]] * 2, atol=2e-3)
    rows[60, 8:] = np.nan  # one damaged frame is forgotten when the history has passed
    assert np.abs(run_c(program, rows, felt[0].shape[1]) - felt[2])[160:].max() < 1e-4


def test_a_nod_is_felt_as_the_gravity_that_was(tmp_path):
    """Means over bins half a step apart from the model's own of the exact integral; what is yet to come of the newest is as now."""
    spec = rig_spec(True)
    export_c(random_model((2,), 8, spec=spec), tmp_path / "hair.h")
    t, fine = np.arange(240) / 60, np.arange(-16000, 16001) / 4000
    angle = 0.6 * np.sin(3 * fine)
    pull = np.stack([0 * fine, -np.cos(angle), np.sin(angle)], axis=1)
    whole = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (pull[1:] + pull[:-1]) / 4000, axis=0)])
    heads = to_quaternion(from_vector(np.outer(0.6 * np.sin(3 * t), [1, 0, 0])))
    rows = np.hstack([t[:, None], np.zeros((240, 3)), heads, np.tile([0.0, -1.0, 0.0], (240, 1))])
    felt = run_c(compiled(tmp_path, WALL_HARNESS), rows, 6 * len(spec.bins)).reshape(240, -1, 6)
    ends = spec.dt * (np.r_[0, np.cumsum(spec.bins)] - 0.5)
    for frame in range(120, 240, 7):
        now, (start, *before) = [np.interp(t[frame], fine, each) for each in pull.T], t[frame] - ends
        sums = np.stack([np.interp([t[frame], *before], fine, each) for each in whole.T], axis=1)
        sums[0] += (start - t[frame]) * np.array(now)
        means = -np.diff(sums, axis=0) / (spec.dt * np.array(spec.bins)[:, None]) - now
        np.testing.assert_allclose(felt[frame, :, :3], spec.bin_weights[:, None] * means, atol=3e-3)


def test_a_gale_is_felt_at_once_and_no_more_than_six_g_of_it(tmp_path):
    """At the first push as at those that follow, along the wind."""
    spec = rig_spec(True)
    export_c(random_model((2,), 8, spec=spec), tmp_path / "hair.h")
    steady = "int i;\n  const float down[3] = {-0.6f, -0.6f, -0.52915f};"
    program = compiled(tmp_path, WALL_HARNESS.replace("int i;", steady).replace("row + 8, out", "down, out"))
    rows = np.zeros((30, 11))
    rows[:, 0], rows[:, 4] = np.arange(30) / 60, 1
    for blown, most in (([1.0, 2.0, -2.0], np.inf), ([3.0, 3.0, 3.0], 6.0)):
        rows[:, 8:] = blown
        felt = run_c(program, rows, 6 * len(spec.bins)).reshape(30, -1, 6)
        wind = np.array(blown) + [0.6, 0.6, 0.52915]
        wind *= min(1, most / (size := np.linalg.norm(wind)))
        assert size < most or size > 1.02 * most
        wanted = np.broadcast_to(np.outer(spec.bin_weights, wind), felt[:, :, :3].shape)
        np.testing.assert_allclose(felt[:, :, :3], wanted, atol=1e-4)
        assert not felt[:, :, 3:].any()


@pytest.mark.parametrize(("spin", "rate"), [(12, 60), (12, 240), (40, 240), (70, 60)])
def test_a_blow_is_felt_in_the_axes_of_a_step_later(tmp_path, spin, rate):
    """Where nothing pulls, a head that spins about a slanted axis begins to move: it counts as turning on by a step of the model's, no
    faster than 25 rad/s, however long the frames are.
    """
    spec, axis, speed = rig_spec(True), np.array([2, -1, 2]) / 3, np.array([0.9, 0.4, -0.2])
    export_c(random_model((2,), 8, spec=spec), tmp_path / "hair.h")
    t = np.arange(round(1.3 * rate)) / rate
    heads = to_quaternion(from_vector(np.outer(spin * t, axis)))
    rows = np.hstack([t[:, None], np.outer(np.maximum(0, t - 1), speed), heads, np.zeros((len(t), 3))])
    felt = run_c(compiled(tmp_path, WALL_HARNESS), rows, 6 * len(spec.bins))[-1].reshape(-1, 6)[:, :3]
    whole = spec.dt * (np.divide(spec.bins, spec.bin_weights)[:, None] * felt).sum(axis=0)
    later = from_vector(axis * spin) @ from_vector(axis * 2 * np.arctan(0.5 * spec.dt * min(spin, 25)))
    np.testing.assert_allclose(whole, -later.T @ speed / 9.81, atol=1e-4)
