# SPDX-License-Identifier: Apache-2.0
"""Starts warp quietly, or says clearly that it is missing."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import ModuleType

from neuralocks_core.cache_folder import cache_folder, writable
from neuralocks_core.errors import NeuralocksError


def start_warp(device: str) -> ModuleType:
    """Import and initialise warp.

    Args:
        device: "cpu", "cuda" or "cuda:N".

    Raises:
        NeuralocksError: warp is not installed, lacks this device, or has no folder for compiled code.
    """
    try:
        import warp as wp
    except ImportError as missing:
        raise NeuralocksError('warp: is not installed; pip install "neuralocks[compare]"') from missing
    wp.config.log_level = wp.LOG_ERROR
    wp.config.enable_backward = False
    with _quiet():
        _init(wp)
        try:
            wp.get_device(device)
        except Exception as unknown:
            raise NeuralocksError(f"device {device}: not found by warp; use cpu") from unknown
    return wp


def _init(wp: ModuleType) -> None:
    """Initialise warp, with another folder for compiled code if its own is not writable."""
    with suppress(OSError):
        wp.init()
        if writable(Path(wp.config.kernel_cache_dir)):
            return
    wp.config.kernel_cache_dir = str(cache_folder("warp") / wp.config.version)
    wp.init()


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep warp's native start from telling that there is no GPU, in lines of its own: it writes past Python."""
    try:
        kept = os.dup(2)
    except OSError:  # a process without a console
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
