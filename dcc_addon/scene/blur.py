# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion blur of live hair: renderers ask for points within the shutter only of objects whose modifiers may deform them,
and live hair, which a handler moves, often has none.
"""

import bpy

from . import curves
from .nodes import geometry_nodes

NAME = "Neuralocks Motion Blur"


def begin(hair, scene) -> None:
    """Give hair that is moved a modifier that changes nothing, for the time of a render."""
    if hair.library is None and curves.has_rest(hair.data) and not hair.is_deform_modified(scene, "RENDER"):
        modifier = hair.modifiers.new(NAME, "NODES")
        modifier.node_group = _nothing()


def end() -> None:
    """Take these modifiers off again."""
    for thing in bpy.data.objects:
        modifier = thing.modifiers.get(NAME) if thing.type == "CURVES" and thing.library is None else None
        if modifier is not None:
            thing.modifiers.remove(modifier)
    tree = bpy.data.node_groups.get(NAME)
    if tree is not None and not tree.users:
        bpy.data.node_groups.remove(tree)


def _nothing():
    """Geometry nodes that hand over what they get."""
    tree = bpy.data.node_groups.get(NAME)
    if tree is None:
        tree, source, target = geometry_nodes(NAME)
        tree.links.new(source, target)
    return tree
