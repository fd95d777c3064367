# SPDX-License-Identifier: Apache-2.0
"""The compiled library for this machine."""

import ctypes
import platform
import sys
from functools import cache
from pathlib import Path

from neuralocks_core.native.body import Body

LAYOUT = 1
"""Changes with the interface; `posed_skin.c` has it too."""
FOLDER = Path(__file__).resolve().parent / "libraries"
ENDINGS = {"linux": "so", "windows": "dll", "macos": "dylib"}
SYSTEMS = {"linux": "linux", "win32": "windows", "darwin": "macos"}
MACHINES = {"x86_64": "x64", "amd64": "x64", "arm64": "arm64", "aarch64": "arm64"}


@cache
def library() -> ctypes.CDLL | None:
    """The library, or None if there is none for this machine, or its system does not load it: then numpy computes the same, bit for
    bit, and takes several times as long. Other threads run while a function of it does.
    """
    system, machine = SYSTEMS.get(sys.platform), MACHINES.get(platform.machine().lower())
    if system is None or machine is None:
        return None
    try:
        found = ctypes.CDLL(str(file_for(f"{system}-{machine}")))
        fits = found.neuralocks_layout() == 1000 * LAYOUT + ctypes.sizeof(Body)
        for name in ("keep_out", "lay", "pose_skin", "carry"):
            getattr(found, f"neuralocks_{name}").restype = None
    except (OSError, AttributeError):  # it does not load, or is another library
        return None
    return found if fits else None


def file_for(target: str) -> Path:
    """Where the library for a target such as linux-x64 lies."""
    return FOLDER / f"neuralocks-{target}.{ENDINGS[target.split('-')[0]]}"
