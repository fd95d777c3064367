# SPDX-License-Identifier: GPL-3.0-or-later
"""Neuralocks for Blender: hair that moves with the character, live, at any frame, without simulation."""

import sys
from pathlib import Path

# Read by Blender before 4.2, which does not know manifests.
bl_info = {
    "name": "Neuralocks",
    "author": "The Neuralocks authors",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "3D View > Sidebar > Neuralocks",
    "description": "Hair that moves with the character, live, at any frame, without simulation",
    "category": "Animation",
}

# The legacy zip carries the packages that an extension gets as wheels. At the end, so that Blender's own numpy comes
# first.
_packages = Path(__file__).parent / "packages"
if _packages.is_dir() and str(_packages) not in sys.path:
    sys.path.append(str(_packages))


def register() -> None:
    """Enable the add-on."""
    from . import registration

    registration.register()


def unregister() -> None:
    """Disable the add-on."""
    from . import registration

    registration.unregister()
