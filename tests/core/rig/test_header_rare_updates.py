# SPDX-License-Identifier: Apache-2.0
"""The header's history where updates are rare or pause, and of models whose bins are not those of the shipped one."""

import subprocess
from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig import rig_spec
from neuralocks_core.rig.export_c import export_c
from tests.core.rig.builders import random_model
from tests.core.rig.c_programs import COMPILERS, HISTORY_HARNESS, compiled, run_c

SPEC = rig_spec(True)


def history_of(folder, spec=SPEC):
    """A program that reads rows of `head_rows` and gives the history at each, (n, bins x 6)."""
    export_c(random_model((2,), 8, spec=spec), folder / "hair.h")
    return compiled(folder, HISTORY_HARNESS)


def head_rows(t, x=0.0, yaw=0.0):
    """Rows (n, 8) float32 of a head at x [m], turned about the vertical by yaw [rad]."""
    rows = np.zeros((len(t), 8), np.float32)
    rows[:, 0], rows[:, 1] = t, x
    rows[:, 4], rows[:, 6] = np.cos(0.5 * np.asarray(yaw)), np.sin(0.5 * np.asarray(yaw))
    return rows


def read(program, rows, spec=SPEC):
    """Histories (n, bins, 6): gravity and acceleration [g], angular velocity [rad/s]."""
    return run_c(program, rows, 6 * len(spec.bins)).reshape(len(rows), -1, 6)


def means(ends, spec=SPEC):
    """What an integral at the ends of the bins, newest first, gives the network."""
    return spec.bin_weights * -np.diff(ends) / (spec.dt * np.array(spec.bins))


def assert_that_means_are_those_of_the_same_integrals(program, t, frames):
    """A head that sways, and one that turns, looked up in double precision."""
    steps = SPEC.dt * np.r_[0, np.cumsum(SPEC.bins)]
    sway, turn = head_rows(t, x=0.02 * np.sin(5 * t)), head_rows(t, yaw=(yaw := 0.3 * np.sin(2 * t)))
    swayed, turned = read(program, sway), read(program, turn)
    assert np.isfinite(swayed).all() and np.isfinite(turned).all()
    t = sway[:, 0].astype(float)  # as the program has them
    span = np.diff(t)
    kicks = np.r_[0, np.cumsum(np.diff(np.diff(sway[:, 1].astype(float)) / span) / -9.81)]
    for last in frames:
        asked = means(np.interp(t[last] - steps - 0.5 * SPEC.dt, t[1 : last + 1] - 0.5 * span[:last], kicks[:last]))
        np.testing.assert_allclose(swayed[last, :, 0], asked, atol=1e-5)
        assert np.abs(swayed[last, :, 1:]).max() < 1e-5
        asked = means(np.interp(t[last] - steps, t[: last + 1], yaw[: last + 1]))
        np.testing.assert_allclose(turned[last, :, 4], asked, atol=3e-5)
        assert np.abs(turned[last, :, [0, 1, 2, 3, 5]]).max() < 1e-5


@pytest.mark.parametrize("pause", [0.5, 1.5, 1.7, 4, 7200])
def test_a_pause_is_felt_as_what_was_missed_spread_over_it(tmp_path, pause):
    """A character is not updated for a while, and has moved on then: in each of the frames that follow."""
    t = np.arange(120) / 60
    t[60:] += pause
    assert_that_means_are_those_of_the_same_integrals(history_of(tmp_path), t, range(60, 90))


def test_a_runner_who_goes_on_after_a_pause_is_not_flung(tmp_path):
    """5 m/s lost and gained over a minute are 0.017 g."""
    t = np.arange(240) / 60
    x = 5 * t
    t[120:] += 60
    x[120:] -= x[120] - x[119]
    assert 0.01 < np.abs(read(history_of(tmp_path), head_rows(t, x))[120:]).max() < 0.02


@pytest.mark.parametrize("pause", [3.19, 3.3, 60])
def test_nothing_is_felt_of_a_pause_between_the_first_two_pushes(tmp_path, pause):
    t = np.r_[0, pause + np.arange(120) / 60]
    assert np.abs(read(history_of(tmp_path), head_rows(t))).max() < 1e-5


@pytest.mark.parametrize("every", [0.5, 1, 1.005, 1.02, 1.2, 1.6, 2])
@pytest.mark.parametrize("updates", [40, 200])
def test_updates_may_be_rare_and_then_be_frames(tmp_path, every, updates):
    """Times of so many entries would go round: those of a level of detail that an engine updates each second or so."""
    t = np.r_[every * np.arange(updates), every * updates + np.arange(240) / 60]
    assert_that_means_are_those_of_the_same_integrals(history_of(tmp_path), t, range(2, len(t)))


def test_a_turn_by_any_angle_between_two_updates_is_felt_as_that_angle(tmp_path):
    """Up to half a turn, where the header's series for the arctangent is at its end, to either side."""
    angles = np.radians(np.random.default_rng(0).permutation(np.linspace(-178, 178, 90)))
    t, yaw = 0.375 * np.arange(91), np.r_[0, np.cumsum(angles)]
    turned = read(history_of(tmp_path), head_rows(t, yaw=yaw))
    steps = SPEC.dt * np.r_[0, np.cumsum(SPEC.bins)]
    for last in range(8, 91):
        np.testing.assert_allclose(turned[last, :, 4], means(np.interp(t[last] - steps, t, yaw)), atol=3e-5)


@pytest.mark.parametrize("spin", [24, 30, 90])
@pytest.mark.parametrize("bins", [(1, 1, 44), (40, 400)], ids=str)
def test_a_spin_in_a_long_bin_is_felt_as_it_is(tmp_path, spin, bins):
    """Up to the limit of 25 rad/s, in the direction in which the head turns, by which angle it may ever have turned."""
    spec = replace(SPEC, bins=bins, taper=0.0)
    t = np.arange(240 * 20) / 240
    felt = read(history_of(tmp_path, spec), head_rows(t, yaw=spin * t), spec)
    np.testing.assert_allclose(felt[-100:, :, 4], min(spin, 25), rtol=1e-3)


def test_a_history_too_long_for_the_headers_numbers_is_refused(tmp_path):
    spec = replace(SPEC, dt=0.5, bins=(1, 600))
    with pytest.raises(NeuralocksError, match=r"history of 302 s, in bins of up to 300 s, is too long .*shorter bins"):
        history_of(tmp_path, spec)
    assert not list(tmp_path.iterdir())


def test_the_header_says_in_seconds_how_far_back_it_reads(tmp_path):
    for spec, reach in ((SPEC, "1.53 s"), (replace(SPEC, dt=1 / 120, bins=(1,) * 30), "0.25 s")):
        export_c(random_model((2,), 8, spec=spec), tmp_path / "hair.h")
        assert f"It remembers the last {reach} as running integrals" in (tmp_path / "hair.h").read_text()


HEAP_HARNESS = HISTORY_HARNESS.replace("#include <stdio.h>", "#include <stdio.h>\n#include <stdlib.h>").replace(
    "  static nl_hair_history history;", "  nl_hair_history *heap = malloc(sizeof *heap);"
)


@pytest.mark.parametrize("optimised", ["-O0", "-O1"])
def test_nothing_is_read_that_was_never_written(tmp_path, optimised):
    """Of a history on the heap, which has only been reset."""
    export_c(random_model((2,), 8, spec=SPEC), tmp_path / "hair.h")
    options = (optimised, "-fsanitize=memory")
    try:
        empty = compiled(tmp_path, "int main(void) { return 0; }\n", options, COMPILERS[2])
        subprocess.run([empty], check=True, capture_output=True)
    except (AssertionError, subprocess.CalledProcessError):
        pytest.skip("this clang has no memory sanitizer")
    source = HEAP_HARNESS.replace("&history", "heap").replace("fwrite(out,", "if (out[0] < 9.0f) fwrite(out,")
    t = np.r_[np.arange(200) / 60, 10 + np.arange(200) / 60]
    read(compiled(tmp_path, source, options, COMPILERS[2]), head_rows(t, x=0.02 * np.sin(5 * t)))
