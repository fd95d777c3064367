# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees of geometry nodes, made alike in every Blender."""

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
