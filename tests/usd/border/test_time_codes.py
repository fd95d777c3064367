# SPDX-License-Identifier: Apache-2.0
"""Which time codes a bake writes."""

import numpy as np
import pytest

from usd.border.time_codes import time_codes


@pytest.mark.parametrize("step", [0.1, 0.25, 0.3])
def test_parts_of_a_range_have_the_numbers_of_the_whole(step):
    """Otherwise a farm's chunks, put together, would have samples twice."""
    whole = time_codes(f"1:12:{step}", 0, 0)
    cut = whole[7]
    parts = [*time_codes(f"1:{cut - step / 2}:{step}", 0, 0), *time_codes(f"{cut}:12:{step}", 0, 0)]
    assert parts == whole and np.allclose(np.diff(whole), step)


def test_a_range_left_out_is_the_shots_in_its_own_frames():
    assert time_codes(None, 0.5, 3.2) == [1.0, 2.0, 3.0] == time_codes(None, 0.5, 3.2, samples=[0.5, 1.0, 1.5])
    assert time_codes(None, 0.5, 3.2, samples=[-1.5, 0.5, 2.5]) == [0.5, 1.5, 2.5], "keys lie as the range begins"
    assert time_codes(None, 2.2, 2.4) == [3.0]
    assert time_codes(None, 1.00001, 3.99999) == [1, 2, 3, 4], "ends that were rounded"
    assert time_codes(None, 0.5, 2.49999, samples=[0.5, 1.5, 2.5]) == [0.5, 1.5, 2.5]
    assert time_codes((1, 24, 48), 1, 48) == [1.0, 24.0, 48.0]
    assert time_codes(None, 2, 3, subframes=2) == [2.0, 2.5, 3.0, 3.5]
    assert np.allclose(time_codes(None, 0.25, 0.5, frame=1 / 24), np.arange(6, 13) / 24)
    assert np.allclose(time_codes("1:2", 0, 0, 2, frame=0.5), [1, 1.25, 1.5, 1.75, 2, 2.25])


@pytest.mark.parametrize("frame", [1 / 24, 1 / 29.97, 1000 / 24, 1000 / 29.97])
def test_frames_are_found_again_where_they_are_no_whole_numbers(frame):
    """By the numbers that a bake wrote, and by those that are typed from its messages."""
    first = 2.5 * frame
    whole = time_codes(None, first, first + 15 * frame, frame=frame)
    assert len(whole) == 16
    for written in (repr, "{:.6g}".format):
        for cut in range(1, 15):
            before = time_codes(f"{written(whole[0])}:{written(whole[cut])}", first, 0, frame=frame)
            after = time_codes(f"{written(whole[cut + 1])}:{written(whole[-1])}", first, 0, frame=frame)
            assert before + after == whole
