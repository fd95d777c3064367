# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry node trees, built the same way in every Blender version, and their modifier inputs."""

import bpy


def geometry_nodes(name: str) -> tuple:
    """A new tree of geometry nodes, the socket that gives the modifier's geometry and the one that takes its result."""
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    if hasattr(tree, "interface"):
        for way in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    else:
        tree.inputs.new("NodeSocketGeometry", "Geometry")
        tree.outputs.new("NodeSocketGeometry", "Geometry")
    return tree, tree.nodes.new("NodeGroupInput").outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0]


def inputs_of(tree) -> list[tuple[str, str]]:
    """Names and identifiers of what a modifier can give a tree; none if there is no tree."""
    if tree is None:
        return []
    if hasattr(tree, "interface"):
        items = tree.interface.items_tree
        sockets = [item for item in items if item.item_type == "SOCKET" and item.in_out == "INPUT"]
    else:
        sockets = tree.inputs
    return [(socket.name, socket.identifier) for socket in sockets]


def read_input(modifier, identifier: str):
    """What a modifier gives its tree; None if it has nothing of this name."""
    if hasattr(modifier, "properties"):  # since 5.2
        return getattr(getattr(modifier.properties.inputs, identifier, None), "value", None)
    return modifier.get(identifier)


def write_input(modifier, identifier: str, value) -> None:
    """Give its tree another value, if the modifier has one of this name. The caller tags the object."""
    if hasattr(modifier, "properties"):
        if read_input(modifier, identifier) is not None:
            getattr(modifier.properties.inputs, identifier).value = value
    elif identifier in modifier:
        modifier[identifier] = value
