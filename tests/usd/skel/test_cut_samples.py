# SPDX-License-Identifier: Apache-2.0
"""A cut that a user names is the first sample at the new place, whatever lies on frames."""

import numpy as np
import pytest

from usd.skel.cut_samples import cut_samples

STEP = 30000 / 1001 / 24
"""Time codes between samples of a clip of 24 frames per second in a stage of 29.97."""


def _jumping(codes: np.ndarray, at: int) -> np.ndarray:
    """A head (T, 3) that nods, and is elsewhere from sample `at` on."""
    return np.stack([0 * codes, 0.02 * np.sin(codes), 3.0 * (np.arange(len(codes)) >= at)], axis=1)


@pytest.mark.parametrize("named", [113 * STEP, 141.108, 141.109, 141.11, 141.0, 141.1, 142.0])
def test_samples_between_frames(named):
    """141.10889 is the sample: named exactly, as printed, or by the frame that first shows it."""
    codes = STEP * np.arange(100, 125)
    assert cut_samples([named], codes, 1.0, _jumping(codes, 13)) == [13]


@pytest.mark.parametrize("rate", [1.0, 1000.0])
def test_time_codes_that_are_not_frames(rate):
    codes = rate * np.arange(100, 125) / 24
    for digits in (6, 9):
        named = float(f"{codes[15]:.{digits}g}")
        assert cut_samples([named], codes, rate / 24, _jumping(codes, 15)) == [15]


def test_a_sample_that_is_named_is_taken_wherever_the_head_jumps():
    codes = np.arange(1.0, 25.0)
    assert cut_samples([12], codes, 1.0, _jumping(codes, 13)) == [11]
    assert list(cut_samples([20, 14.0005, 14, 99, -4, 1, 1.0002], codes, 1.0, _jumping(codes, 13))) == [13, 19]
    assert list(cut_samples([24.0005], codes, 1.0, _jumping(codes, 23))) == [23]
    assert not len(cut_samples([5], np.array([5.0]), 1.0, np.zeros((1, 3))))
