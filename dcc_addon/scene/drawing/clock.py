# SPDX-License-Identifier: GPL-3.0-or-later
"""How a scene counts time: the frame that is shown, the rate, and time stretching."""


def shown_frame(scene) -> float:
    """The frame that is shown, with its fraction, as the timeline counts; Blender's `frame_current_final` counts
    stretched time.
    """
    return scene.frame_current + scene.frame_subframe


def rate_of(scene) -> float:
    """Frames per second."""
    return scene.render.fps / scene.render.fps_base


def stretch_of(scene) -> float:
    """How many frames of a render an animation's frame lasts (Time Stretching)."""
    return scene.render.frame_map_new / scene.render.frame_map_old
