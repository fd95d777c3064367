# SPDX-License-Identifier: GPL-3.0-or-later
"""Dependencies between objects, as Blender keeps them until something is added or removed."""

import bpy


def found_anew() -> None:
    """Let Blender look at that anew with the next update. Where nothing of a rig but muted tracks was animated when it looked
    last, for a render say, 4.5 to 5.2 go on in the view without them after they are unmuted, and so does whoever steps frames.
    """
    bpy.data.objects.remove(bpy.data.objects.new("Neuralocks Probe", None))  # any object that comes or goes does it
