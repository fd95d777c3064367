# SPDX-License-Identifier: GPL-3.0-or-later
"""Work beside Blender that does not end well."""

import gc
import time
import weakref

import pytest

from dcc_addon.services.threaded import Threaded


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
