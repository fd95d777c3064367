# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion blur of live hair: renderers ask for points within the shutter only of objects whose modifiers may deform them,
and live hair, which a handler moves, often has none. If hair has velocities, Cycles blurs it along these instead: a groom from a
file may have some, of the motion that it had there.
"""

import bpy

from . import curves
from .nodes import geometry_nodes

NAME = "Neuralocks Motion Blur"
CACHED = "Neuralocks Cache Blur"
"""The same for hair that plays a cache: it stays with the cache, also in files."""
TREE = f".{NAME}"
"""The dot keeps it out of menus. It stays in the session; in files only for hair with a cache, as they only hold data with users."""
VELOCITY = "velocity"
"""The attribute that Cycles reads."""


def begin(hair, scene) -> None:
    """Give moved hair a modifier that only takes its velocities off, for the duration of a render; one, however many of the scenes that
    are drawn have the hair.
    """
    if hair.library is not None or not curves.has_rest(hair.data) or NAME in hair.modifiers:
        return
    if has_velocities(hair) or not hair.is_deform_modified(scene, "RENDER"):
        again(hair)


def again(hair) -> None:
    """Give hair this modifier back."""
    modifier = hair.modifiers.new(NAME, "NODES")
    modifier.node_group = _without_velocities()


def has_velocities(hair) -> bool:
    """Whether a groom has velocities of its own."""
    return VELOCITY in hair.data.attributes


def attach(hair) -> None:
    """Take velocities of its own off hair that plays a cache: one with samples between the frames has none, and Blender 4.2 reads
    none.
    """
    modifier = hair.modifiers.get(CACHED)
    if modifier is None and has_velocities(hair):
        modifier = hair.modifiers.new(CACHED, "NODES")
        modifier.node_group = _without_velocities()
        if hair.override_library is None:  # otherwise Blender keeps it above those from the other file
            hair.modifiers.move(len(hair.modifiers) - 1, 0)  # below the cache, which may have velocities
    if modifier is not None:
        modifier.show_viewport = modifier.show_render = True


def detach(hair) -> None:
    """Give it these velocities back."""
    modifier = hair.modifiers.get(CACHED)
    if modifier is not None and hair.override_library is not None and modifier.is_override_data:
        modifier.show_viewport = modifier.show_render = False  # Blender would bring it back
    elif modifier is not None:
        hair.modifiers.remove(modifier)


def end() -> list[str]:
    """Remove these modifiers again, and give the names of the hair that had them. Their node group stays: if a scene is rendered into
    a strip of another, the outer render continues, and Blender 5.2 crashes when data that it uses is removed.
    """
    ended = []
    for thing in bpy.data.objects:
        modifier = thing.modifiers.get(NAME) if thing.type == "CURVES" and thing.library is None else None
        if modifier is not None:
            thing.modifiers.remove(modifier)
            ended.append(thing.name_full)
    return ended


def _without_velocities():
    """Geometry nodes that return their input without velocities."""
    tree = bpy.data.node_groups.get((TREE, None))  # not one linked from another file
    if tree is None:
        tree, source, target = geometry_nodes(TREE)
        node = tree.nodes.new("GeometryNodeRemoveAttribute")
        node.inputs["Name"].default_value = VELOCITY
        tree.links.new(source, node.inputs["Geometry"])
        tree.links.new(node.outputs["Geometry"], target)
    return tree
