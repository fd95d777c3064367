# SPDX-License-Identifier: Apache-2.0
"""Warp starts quietly, whatever a machine lacks."""

import os
import subprocess
import sys

import pytest

pytest.importorskip("warp", reason="the extra 'train' is not installed")

SCRIPT = """
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.warp_device import start_warp
try:
    start_warp("cuda")
except NeuralocksError as error:
    print(error)
"""


def test_a_gpu_that_is_not_there_is_refused_in_one_line():
    """Warp's own lines about it, written past Python, would come before it."""
    hidden = {**os.environ, "CUDA_VISIBLE_DEVICES": "-1"}
    done = subprocess.run([sys.executable, "-c", SCRIPT], env=hidden, capture_output=True, text=True, check=True)
    assert done.stdout == "device cuda: not found by warp; use cpu\n" and done.stderr == ""
