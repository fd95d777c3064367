# SPDX-License-Identifier: GPL-3.0-or-later
"""Work beside Blender: how far it is, what it gives, and how it stops."""

import gc
import threading
import time
import weakref

import pytest

from dcc_addon.services.work.threaded import Threaded


class _Stage:
    """Stands in for what work opens."""


@pytest.mark.parametrize("how", ["cancelled", "failed"])
def test_what_stopped_work_had_open_is_closed_at_once(how):
    """Not only at the next garbage collection: while a stage is open, opening its file again gives the old content."""
    opened = []

    def work(say):
        stage = _Stage()
        opened.append(weakref.ref(stage))
        if how == "failed":
            raise ValueError
        while True:
            say(0, 1)

    gc.disable()
    try:
        job = Threaded(work).start()
        if how == "cancelled":
            job.cancel()
        while job.running:
            time.sleep(0.001)
        del job
        assert opened[0]() is None
    finally:
        gc.enable()


def test_work_says_its_share_of_a_longer_one_and_gives_its_result():
    go_on = threading.Event()

    def work(say):
        say(1, 4, "")
        go_on.wait(10)
        return "made"

    steps = Threaded(work, "Making").steps(0.5, 0.9)
    while (said := next(steps)) != (0.6, 1, "Making"):
        assert said == (0.5, 1, "Making")  # before it has begun
    go_on.set()
    with pytest.raises(StopIteration) as ended:
        while True:
            next(steps)
    assert ended.value.value == "made"


def test_what_work_raises_is_raised_where_it_is_waited_for():
    def work(_say):
        raise ValueError("it fails")

    with pytest.raises(ValueError, match="it fails"):
        list(Threaded(work).steps())
