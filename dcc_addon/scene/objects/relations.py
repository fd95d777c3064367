# SPDX-License-Identifier: GPL-3.0-or-later
"""Dependencies between objects, as Blender keeps them until something is added or removed."""

import bpy


def found_anew() -> None:
    """Make Blender find the dependencies again with the next update. If a rig only had muted tracks when Blender last looked, for
    example for a render, 4.5 to 5.2 leave them out of the view after they are unmuted, and also when frames are stepped.
    """
    bpy.data.objects.remove(bpy.data.objects.new("Neuralocks Probe", None))  # adding or removing any object does it
