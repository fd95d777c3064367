# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders from a window run in a thread of their own, in which the handlers move live hair. A viewport that is drawn meanwhile
reads what is being written, and Blender crashes; with a locked interface, it draws nothing but the render.
"""

import bpy


def lock() -> None:
    """Lock the interface during renders of any scene of this file: handlers are called by all of them."""
    for scene in bpy.data.scenes:
        if scene.library is None and not scene.render.use_lock_interface:
            scene.render.use_lock_interface = True
