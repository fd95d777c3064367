# SPDX-License-Identifier: Apache-2.0
"""The header's history of the head: that of a bake at any frame rate, and nothing damaged stays in it."""

import numpy as np
import pytest

from neuralocks_core.motion import Clip
from neuralocks_core.rig import RigSampler, rig_spec
from neuralocks_core.rig.export_c import HISTORY_BYTES, export_c
from neuralocks_core.rotation import from_vector, to_quaternion
from neuralocks_core.wind import Wind
from tests.core.rig.builders import character, random_model
from tests.core.rig.c_programs import COMPILERS, HISTORY_HARNESS, compiled, run_c


@pytest.mark.parametrize("rate", [30, 60, 47, 144])
def test_the_headers_history_is_that_of_the_bake(tmp_path, rate):
    """A nodding, swaying head, pushed at any frame rate: entries of fast frames must reach as far back."""
    model = random_model(spec=rig_spec(True))
    export_c(model, tmp_path / "hair.h")
    who = character()
    t = np.arange(0, 4, 1 / rate)
    joints = np.tile(who.skeleton.bind, (len(t), 1, 1, 1))
    joints[:, who.head, :3, :3] = from_vector(np.outer(0.6 * np.sin(4 * t) * np.minimum(t, 1), [1, 0.4, 0]))
    joints[:, who.head, 0, 3] += 0.15 * np.sin(5 * t) * np.minimum(t, 1)
    wanted = RigSampler(model.spec, who, Clip(t, joints)).features(t)[:, 15:]
    quaternions = to_quaternion(joints[:, who.head, :3, :3])
    rows = np.concatenate([t[:, None], joints[:, who.head, :3, 3], quaternions], axis=1)
    ours = run_c(compiled(tmp_path, HISTORY_HARNESS), rows, wanted.shape[1])
    late = t > 2
    error = np.sqrt(np.square(ours - wanted)[late].mean() / np.square(wanted[late]).mean())
    assert error < 0.03, error


@pytest.mark.parametrize("steps", [(0.014, 0.022), (0.04, 0.05), (0.02, 0.2)], ids=str)
def test_means_over_bins_are_exact_at_uneven_rates(tmp_path, steps):
    """Within 1e-6 of the same integrals, looked up in double precision, from the second push on, of a head that sways."""
    spec = rig_spec(True)
    export_c(random_model(spec=spec), tmp_path / "hair.h")
    t = np.cumsum(np.random.default_rng(0).uniform(*steps, 300)).astype(np.float32)
    rows = np.zeros((len(t), 8), np.float32)
    rows[:, 0], rows[:, 1], rows[:, 4] = t, 0.02 * np.sin(5 * t), 1
    ours = run_c(compiled(tmp_path, HISTORY_HARNESS), rows, 6 * len(spec.bins)).reshape(len(t), -1, 6)
    span = np.diff(t)
    velocity = np.diff(rows[:, 1]) / span
    middle, kicks = (
        t[1:] - 0.5 * span.astype(float),
        np.r_[0, np.cumsum(np.diff(velocity) / np.float32(-9.81), dtype=float)],
    )
    for last in range(1, 120):
        when = np.r_[0, np.cumsum(spec.bins)] + 0.5
        sums = np.interp(t[last] - when * spec.dt, np.r_[t[0], middle[:last]], np.r_[0, kicks[:last]])
        wanted = spec.bin_weights * -np.diff(sums) / (spec.dt * np.array(spec.bins))
        assert np.abs(ours[last, :, 0] - wanted).max() < 1e-6
        assert np.abs(ours[last, :, 1:]).max() < 1e-6


@pytest.mark.parametrize("rate", [60, 144, 300])
def test_of_a_head_that_turns_accelerations_are_felt_in_the_axes_of_a_bake(tmp_path, rate):
    """The network reads what was felt in the axes that the head had a step later: a fast turn in a fast sway is off by that."""
    model = random_model(spec=rig_spec(True))
    export_c(model, tmp_path / "hair.h")
    who, t = character(), np.arange(0, 4, 1 / rate)
    joints = np.tile(who.skeleton.bind, (len(t), 1, 1, 1))
    joints[:, who.head, :3, :3] = from_vector(np.outer(0.7 * np.sin(6 * t), [0, 1, 0.3]))
    joints[:, who.head, 0, 3] += 0.1 * np.sin(8 * t)
    wanted = RigSampler(model.spec, who, Clip(t, joints)).features(t)[:, 15:]
    quaternions = to_quaternion(joints[:, who.head, :3, :3])
    rows = np.concatenate([t[:, None], joints[:, who.head, :3, 3], quaternions], axis=1)
    ours = run_c(compiled(tmp_path, HISTORY_HARNESS), rows, wanted.shape[1])
    felt, asked = (values.reshape(len(t), -1, 2, 3)[t > 2][:, :, 0] for values in (ours, wanted))
    error = np.sqrt(np.square(felt - asked).mean() / np.square(asked).mean())
    assert error < 3.5 / rate + 0.02, error


@pytest.mark.parametrize("rate", [30, 60, 144])
def test_a_wind_is_felt_as_in_a_bake(tmp_path, rate):
    """The history's direction of gravity is gravity and wind, as the header says; that of the input stays gravity's."""
    model = random_model(spec=rig_spec(True))
    export_c(model, tmp_path / "hair.h")
    who, t, wind = character(), np.arange(0, 4, 1 / rate), Wind((3.0, 1.0, -6.0), 1.0)
    joints = np.tile(who.skeleton.bind, (len(t), 1, 1, 1))
    joints[:, who.head, :3, :3] = from_vector(np.outer(0.6 * np.sin(4 * t), [0.5, 1, 0]))
    wanted = RigSampler(model.spec, who, Clip(t, joints)).features(t, wind=wind)[:, 15:]
    quaternions = to_quaternion(joints[:, who.head, :3, :3])
    down = wind.at(t) / 9.81 - [0, 1, 0]
    rows = np.concatenate([t[:, None], joints[:, who.head, :3, 3], quaternions, down], axis=1)
    harness = HISTORY_HARNESS.replace("row[8]", "row[11]").replace(
        "    nl_hair_history_push",
        "    history.down[0] = row[8], history.down[1] = row[9], history.down[2] = row[10];\n    nl_hair_history_push",
    )
    ours = run_c(compiled(tmp_path, harness), rows, wanted.shape[1])
    error = np.sqrt(np.square(ours - wanted)[t > 2].mean() / np.square(wanted[t > 2]).mean())
    assert error < 0.03, error
    # At first, and so after a reset, the wind of that moment has always blown.
    felt = ours.reshape(len(t), -1, 6)
    steady = (wind.at(t[0]) / 9.81) @ joints[0, who.head, :3, :3]
    np.testing.assert_allclose(felt[0, :, :3], np.outer(model.spec.bin_weights, steady), atol=1e-5)
    np.testing.assert_allclose(felt[1, :, :3], felt[0, :, :3], atol=0.1)


@pytest.mark.parametrize(
    ("compiler", "options"),
    [(COMPILERS[0], ()), (COMPILERS[0], ("-ffast-math",)), (COMPILERS[2], ("-ffast-math",))],
    ids=["gcc", "gcc fast", "clang fast"],
)
def test_one_damaged_frame_does_not_stay_in_the_history(tmp_path, compiler, options):
    """An absurd position is felt as a jump and forgotten when the history has passed; NaN, infinity and a damaged time are ignored,
    even if the compiler was told that there are no infinities."""
    export_c(random_model(spec=rig_spec(True)), tmp_path / "hair.h")
    program = compiled(tmp_path, HISTORY_HARNESS, ("-O2", *options), compiler)
    for damaged in (1e30, -3.4e38, np.inf, np.nan):
        rows = np.zeros((240, 8), np.float32)
        rows[:, 0], rows[:, 4] = np.arange(240) / 60, 1
        rows[60, 1:4] = damaged
        felt = run_c(program, rows, 6 * len(rig_spec(True).bins))
        assert np.isfinite(felt).all() and np.abs(felt[61:70]).max() < 7, damaged
        assert (np.abs(felt[61:70]).max() > 0.1) == np.isfinite(damaged), damaged
        assert np.abs(felt[200:]).max() < 1e-5, damaged
        rows[60], rows[60, 0] = rows[59], damaged
        assert np.abs(run_c(program, rows, felt.shape[1])).max() < 1e-5, damaged
        rows[60], rows[60, 4:] = rows[59], damaged  # a rotation, at most taken for another turn
        rows[60, 0] += 1 / 60
        assert np.isfinite(felt := run_c(program, rows, felt.shape[1])).all(), damaged
        assert np.abs(felt[200:]).max() < 1e-5, damaged
        assert np.isfinite(damaged) or np.abs(felt).max() < 1e-5, damaged


def test_the_header_passes_on_no_more_of_a_teleport_and_of_a_spin_than_the_bake(tmp_path):
    """0.2 m from one frame to the next is 18 g, of which 6 g are felt; of 60 rad/s, 25 are felt."""
    model = random_model(spec=rig_spec(True))
    export_c(model, tmp_path / "hair.h")
    who, t = character(), np.arange(90) / 30
    joints = np.tile(who.skeleton.bind, (len(t), 1, 1, 1))
    joints[:, who.head, 0, 3] += np.where(t > 1, 0.2, 0.0)
    joints[:, who.head, :3, :3] = from_vector(np.outer(60.0 * np.clip(t - 1.5, 0, 0.2), [0, 1, 0]))
    wanted = RigSampler(model.spec, who, Clip(t, joints)).features(t)[:, 15:]
    quaternions = to_quaternion(joints[:, who.head, :3, :3])
    rows = np.concatenate([t[:, None], joints[:, who.head, :3, 3], quaternions], axis=1)
    ours = run_c(compiled(tmp_path, HISTORY_HARNESS), rows, wanted.shape[1])
    felt, asked = (values.reshape(len(t), -1, 2, 3) for values in (ours, wanted))
    assert np.abs(asked).max(axis=(0, 1, 3)) == pytest.approx([6, 25], rel=1e-4)
    np.testing.assert_allclose(felt[:, :, 1], asked[:, :, 1], atol=0.01)
    np.testing.assert_allclose(felt[:, 0, 0], asked[:, 0, 0], atol=0.01)


@pytest.mark.parametrize("rate", [30, 60, 120, 240, 500])
def test_a_sudden_start_and_turn_are_felt_alike_at_any_rate(tmp_path, rate):
    """A controller starts a character at 2 m/s, turns the head by 45 degrees, or both, within one frame, however short; of 20 g and
    50 rad/s for a tenth of a second, as little is passed on as by a bake.
    """
    model = random_model(spec=rig_spec(True))
    export_c(model, tmp_path / "hair.h")
    program, who, t = compiled(tmp_path, HISTORY_HARNESS), character(), np.arange(round(2 * rate) + 1) / rate
    steps, since = np.array(model.spec.bins)[:, None, None], np.maximum(0, t - 1)
    lasting = np.minimum(since, 0.1)
    for place, turn in (
        (2.0 * since, 0 * t),
        (0 * t, np.where(t > 1, np.pi / 4, 0)),
        (2.0 * since, np.where(t > 1, np.pi / 4, 0)),
        (20 * 9.81 * lasting * (since - 0.5 * lasting), 50 * lasting),
    ):
        joints = np.tile(who.skeleton.bind, (len(t), 1, 1, 1))
        joints[:, who.head, 0, 3] += place
        joints[:, who.head, :3, :3] = from_vector(np.outer(turn, [0, 1, 0]))
        wanted = RigSampler(model.spec, who, Clip(t, joints)).features([1.2])[0, 15:]
        quaternions = to_quaternion(joints[:, who.head, :3, :3])
        rows = np.concatenate([t[:, None], joints[:, who.head, :3, 3], quaternions], axis=1)
        ours = run_c(program, rows, len(wanted))[round(1.2 * rate)]
        # Each blow may be in a neighbouring step; their sums are the same.
        felt, asked = ((steps * values.reshape(-1, 2, 3)).sum(axis=0) for values in (ours, wanted))
        assert np.abs(felt - asked).max() < 0.15 * np.abs(asked).max(), (felt, asked)


LONG_HARNESS = """#include "hair.h"
#include <math.h>
#include <stdio.h>
int main(void) {
  static nl_hair_history history;
  static float out[6 * NL_HAIR_BINS];
  const float down[3] = {0.0f, -1.0f, 0.0f};
  int frame;
  nl_hair_history_reset(&history);
  for (frame = 0; frame < 60 * 600; ++frame) {
    const float phase = 6.2831853f * (float)(frame % 60) / 60.0f;
    const float place[3] = {0.05f * sinf(phase), 1.6f, 0.0f};
    const float head[4] = {cosf(0.2f * sinf(phase)), 0.0f, sinf(0.2f * sinf(phase)), 0.0f};
    nl_hair_history_push(&history, (double)frame / 60.0, place, head);
    nl_hair_history_read(&history, down, out);
    if (frame % 60 == 7) fwrite(out, sizeof out, 1, stdout);
  }
  return 0;
}
"""


def test_nothing_adds_up_over_minutes(tmp_path):
    """Times and integrals go round their whole range many times in ten minutes: each second of a motion feels like the one before."""
    export_c(random_model(spec=rig_spec(True)), tmp_path / "hair.h")
    felt = run_c(compiled(tmp_path, LONG_HARNESS), [], 6 * len(rig_spec(True).bins))
    assert np.abs(felt[3]).max() > 0.1
    np.testing.assert_allclose(felt[3:], np.tile(felt[3], (597, 1)), atol=1e-4)


def test_a_report_gives_the_size_that_the_compiler_finds(tmp_path):
    export_c(random_model(spec=rig_spec(True)), tmp_path / "hair.h")
    program = """#include "hair.h"
#include <stdio.h>
int main(void) {
  const float size = (float)sizeof(nl_hair_history);
  fwrite(&size, sizeof size, 1, stdout);
  return 0;
}
"""
    assert run_c(compiled(tmp_path, program), [], 1).item() == HISTORY_BYTES


CLOCK_HARNESS = """#include "hair.h"
#include <stdio.h>
int main(void) {
  static nl_hair_history history;
  static float out[6 * NL_HAIR_BINS];
  const float head[4] = {1.0f, 0.0f, 0.0f, 0.0f}, down[3] = {0.0f, -1.0f, 0.0f};
  int frame;
  nl_hair_history_reset(&history);
  for (frame = 0; frame < 200; ++frame) {
    const double time = 36000.0 + (double)frame / 60.0;
    const float place[3] = {0.0f, 1.6f, 5.0f * (float)frame / 60.0f};
    nl_hair_history_push(&history, @CLOCK@, place, head);
    nl_hair_history_read(&history, down, out);
    if (frame > 100) fwrite(out, sizeof out, 1, stdout);
  }
  return 0;
}
"""


def test_a_clock_in_double_is_still_exact_after_hours(tmp_path):
    """A character runs at 5 m/s: nothing is felt. A clock in float would be too coarse; the example does not use one."""
    export_c(random_model(spec=rig_spec(True)), tmp_path / "hair.h")
    felt = []
    for clock in ("time", "(double)(float)time"):
        program = compiled(tmp_path, CLOCK_HARNESS.replace("@CLOCK@", clock))
        felt.append(np.abs(run_c(program, [], 6 * len(rig_spec(True).bins))).max())
    assert felt[0] < 1e-3 and felt[1] > 0.1
    example = (tmp_path / "hair_example.c").read_text()
    assert "double time" in example and "(double)time" not in example


def test_a_history_that_nobody_reset_keeps_no_engine_waiting(tmp_path):
    """Whatever is in it then: an endless search would end this test by its time limit."""
    export_c(random_model(spec=rig_spec(True)), tmp_path / "hair.h")
    program = HISTORY_HARNESS.replace("nl_hair_history_reset(&history);", "history.count = 2; (void)row;").replace(
        "nl_hair_history_push(&history, (double)row[0], row + 1, row + 4);", ""
    )
    count = 6 * len(rig_spec(True).bins)
    assert run_c(compiled(tmp_path, program), np.zeros((1, 8), np.float32), count).shape == (1, count)
