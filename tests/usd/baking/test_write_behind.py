# SPDX-License-Identifier: Apache-2.0
"""What is written in the background is written in order, and its errors are heard."""

import threading
import time

import pytest

from usd.baking.layer.write_behind import WriteBehind


def test_calls_are_made_in_order_and_all_of_them():
    done = []
    with WriteBehind() as behind:
        for number in range(20):
            behind.put(lambda number: time.sleep(0.001) or done.append(number), number)
            assert len(done) >= number, "no more than one is ahead"
    assert done == list(range(20))


@pytest.mark.parametrize("later", [0, 2])
def test_the_error_of_a_call_is_raised_and_no_other_call_made(later):
    done = []

    def fails():
        raise OSError("full")

    with pytest.raises(OSError, match="^full$"), WriteBehind() as behind:
        behind.put(fails)
        for number in range(later):
            behind.put(done.append, number)
    assert not done


def test_who_fails_meanwhile_fails_after_the_call_under_way():
    """What was computed is saved first; its own error would be of no interest."""
    begun, done = threading.Event(), []

    def slow():
        begun.set()
        time.sleep(0.05)
        done.append(1)
        raise OSError("full")

    with pytest.raises(KeyboardInterrupt), WriteBehind() as behind:
        behind.put(slow)
        begun.wait()
        raise KeyboardInterrupt
    assert done == [1]


def test_a_program_that_is_stopped_twice_does_not_end_later():
    """Python waits at its end for all threads but such; what the bake has unlocked by then may be another process's."""
    threads = []
    with WriteBehind() as behind:
        for _ in range(2):
            behind.put(lambda: threads.append(threading.current_thread()))
    assert all(each.daemon for each in threads) and len(threads) == 2


def test_a_call_that_cannot_begin_is_not_waited_for(monkeypatch):
    """As where there are too many threads, or somebody stops just then."""

    def refused(thread):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refused)
    with pytest.raises(RuntimeError, match="start new"), WriteBehind() as behind:
        behind.put(print)
