# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties that name files."""

import bpy

_RELATIVE = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5) else set()
FILE = {"subtype": "FILE_PATH", "options": _RELATIVE}
"""How such a property is made; since 4.5 Blender warns of // where it is not told that we know what it means."""
