# SPDX-License-Identifier: Apache-2.0
"""Warp, started quietly, or a clear word that it is missing."""

from types import ModuleType

from neuralocks_core.errors import NeuralocksError


def start_warp(device: str) -> ModuleType:
    """Import and initialise warp.

    Args:
        device: "cpu", "cuda" or "cuda:N".

    Raises:
        NeuralocksError: warp is not installed, or has no such device.
    """
    try:
        import warp as wp
    except ImportError as missing:
        raise NeuralocksError("reference: needs warp; pip install 'neuralocks[compare]'") from missing
    wp.config.log_level = wp.LOG_ERROR
    wp.config.enable_backward = False
    wp.init()
    try:
        wp.get_device(device)
    except Exception as unknown:
        raise NeuralocksError(f"device {device}: not found by warp; use cpu") from unknown
    return wp
