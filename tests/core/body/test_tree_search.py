# SPDX-License-Identifier: Apache-2.0
"""Searches of a k-d tree that several threads share."""

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Future
from traceback import walk_stack

import numpy as np
import pytest
from scipy.spatial import cKDTree

from neuralocks_core.body.tree_search import BLOCK, SHARE, search, surface_tree

_RANDOM = np.random.default_rng(0).normal(size=(2000, 3))


@pytest.mark.parametrize("k", [1, np.arange(1, 4)])
@pytest.mark.parametrize("count", [0, 5, 4 * SHARE + 1])
def test_the_threads_find_what_one_finds(count, k, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 3)
    rng = np.random.default_rng(1)
    tree, points = cKDTree(rng.normal(size=(500, 3))), rng.normal(size=(count, 3))
    for found, wanted in zip(search(tree, points, k), tree.query(points, k), strict=True):
        assert found.dtype == wanted.dtype
        np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize(
    "surface",
    [
        _RANDOM,
        np.round(_RANDOM),
        _RANDOM * [1, 1, 0],
        np.repeat(2.0 ** -np.arange(1000.0)[:, None], 3, axis=1),
        np.concatenate([1e-9 * _RANDOM, [[1e7, 1e7, 1e7]]]),
        _RANDOM[:0],
    ],
    ids=["cloud", "on one another", "plane", "ever closer", "one far away", "none"],
)
def test_the_tree_of_a_surface_finds_what_scipys_own_finds(surface):
    places = np.random.default_rng(1).normal(size=(500, 3)) * np.geomspace(1e-3, 10, 500)[:, None]
    for k in (1, np.arange(1, 5)):
        found, wanted = (tree.query(places, k)[0] for tree in (surface_tree(surface), cKDTree(surface)))
        np.testing.assert_allclose(found, wanted, rtol=1e-15)


@pytest.mark.skipif(os.name == "nt", reason="no signal reaches one process alone")
@pytest.mark.parametrize("blocks", [1, 5])
def test_ctrl_c_waits_for_the_threads_which_end_early(blocks, monkeypatch):
    """Else they go on in memory that is given back; and a search around a dense body takes many seconds."""
    monkeypatch.setattr(os, "cpu_count", lambda: 3)
    main = threading.main_thread().ident
    heard, ended = threading.Event(), []

    def press():
        """When all threads search, and the first one waits for what they find."""
        while Future.result.__code__ not in [frame.f_code for frame, _ in walk_stack(sys._current_frames()[main])]:
            time.sleep(0.01)
        signal.pthread_kill(main, signal.SIGINT)

    all_search = threading.Barrier(3, press)

    def hear(*_):
        heard.set()
        raise KeyboardInterrupt

    class Slow:
        def query(self, points, k):
            if not heard.is_set():
                all_search.wait()
                heard.wait()
            time.sleep(0.2)  # in which a search that does not wait is over
            ended.append(len(points))
            return np.zeros(len(points)), np.zeros(len(points), int)

    before = signal.signal(signal.SIGINT, hear)
    try:
        with pytest.raises(KeyboardInterrupt):
            search(Slow(), np.zeros((3 * blocks * BLOCK, 3)))
    finally:
        signal.signal(signal.SIGINT, before)
    assert set(ended) == {BLOCK}
    assert len(ended) == 3 if blocks == 1 else 3 <= len(ended) < 3 * blocks


@pytest.mark.skipif(os.name == "nt", reason="no signal reaches one process alone")
def test_hair_that_is_grown_is_stopped_without_a_crash():
    code = """import os, signal, threading
import numpy as np
from neuralocks_core.hairstyles.obstacle import _to_surface
signal.signal(signal.SIGINT, signal.default_int_handler)
rng = np.random.default_rng(1)
body, grid = rng.uniform(size=(20_000, 3)), rng.uniform(size=(400_000, 3))
try:
    threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    while True:  # a fast machine is done with one before the signal comes
        _to_surface(grid, body, np.arange(19_998).reshape(-1, 3))
except KeyboardInterrupt:
    raise SystemExit(130) from None"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (130, "")
