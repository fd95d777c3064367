# SPDX-License-Identifier: GPL-3.0-or-later
"""A render engine of our own, which sees what a renderer is given and draws nothing."""

from contextlib import contextmanager

import bpy

ENGINE = "WITNESS"


@contextmanager
def witness(look):
    """In this block, there is the render engine ENGINE, which calls look(engine, graph) for each view layer that it renders."""

    class Witness(bpy.types.RenderEngine):
        bl_idname, bl_label = ENGINE, "Witness"

        def render(self, graph):
            look(self, graph)

    bpy.utils.register_class(Witness)
    try:
        yield
    finally:
        bpy.utils.unregister_class(Witness)


def film(scene) -> None:
    """Give a scene a camera, and pictures of a few pixels."""
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    scene.render.resolution_x = scene.render.resolution_y = 8
