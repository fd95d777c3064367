# SPDX-License-Identifier: GPL-3.0-or-later
"""View layers: Blender poses a character only in those that show it or what it moves. In others it may be evaluated,
because the panel points at it, but stands still.
"""

from contextlib import contextmanager

import bpy

from ..drawing.visibility import enabled
from .binding import armatures_of
from .carried import bodies_of, hairs_of


def layer_of(armature, scene):
    """The view layer in which to look at an armature: the one in view, if it moves there, otherwise preferably one that Blender has
    evaluated; None if it moves in none.
    """
    seen = bpy.context.view_layer if bpy.context.scene == scene else None
    if seen is not None and _moves(armature, scene, seen, "VIEWPORT"):
        return seen
    others = sorted(scene.view_layers, key=lambda layer: layer.depsgraph is None)
    return next((layer for layer in others if layer != seen and _moves(armature, scene, layer, "VIEWPORT")), None)


def elsewhere(armature, scene, graph) -> bool:
    """Whether an armature moves in other view layers, but not in that of `graph`."""
    if armature is None or len(scene.view_layers) < 2 or _moves(armature, scene, graph.view_layer, graph.mode):
        return False
    return any(_moves(armature, scene, layer, graph.mode) for layer in scene.view_layers)


@contextmanager
def working_in(scene, layer):
    """In this block, Blender works on this view layer; scripts render scenes that are not in view and have several."""
    if scene == bpy.context.scene and layer == bpy.context.view_layer:
        yield
    else:
        with bpy.context.temp_override(scene=scene, view_layer=layer):
            yield


def graph_of(scene, layer):
    """The depsgraph of a view layer, evaluated."""
    with working_in(scene, layer):
        return bpy.context.evaluated_depsgraph_get()


def _moves(armature, scene, layer, mode: str) -> bool:
    """Whether a view layer shows an armature or something that it moves; `mode` as of a depsgraph, "VIEWPORT" or "RENDER", since
    things may be disabled in either.
    """
    if enabled(armature, layer, mode):
        return True
    carried = (thing for carried_by in (hairs_of, bodies_of) for thing in carried_by(armature, scene))
    return any(enabled(thing, layer, mode) and armature in armatures_of(thing) for thing in carried)
