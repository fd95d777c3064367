# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion blur of live hair: renderers ask for points within the shutter only of objects whose modifiers may deform them,
and live hair, which a handler moves, often has none.
"""

import bpy

from . import curves
from .nodes import geometry_nodes

NAME = "Neuralocks Motion Blur"
TREE = f".{NAME}"
"""The dot keeps it out of menus: it stays in the session, and is in no file, which holds what has users only."""


def begin(hair, scene) -> None:
    """Give hair that is moved a modifier that changes nothing, for the time of a render."""
    if hair.library is None and curves.has_rest(hair.data) and not hair.is_deform_modified(scene, "RENDER"):
        modifier = hair.modifiers.new(NAME, "NODES")
        modifier.node_group = _nothing()


def end() -> None:
    """Take these modifiers off again. Their node group stays: where a scene is rendered into the strip of another, the
    outer render goes on, and Blender 5.2 crashes when data that it holds is removed.
    """
    for thing in bpy.data.objects:
        modifier = thing.modifiers.get(NAME) if thing.type == "CURVES" and thing.library is None else None
        if modifier is not None:
            thing.modifiers.remove(modifier)


def _nothing():
    """Geometry nodes that hand over what they get."""
    tree = bpy.data.node_groups.get(TREE)
    if tree is None:
        tree, source, target = geometry_nodes(TREE)
        tree.links.new(source, target)
    return tree
