# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes that one render draws together."""

from .other_scenes import homes


def drawn_with(scene) -> list:
    """The scene and those whose layers its compositor uses, each after those whose characters it draws. Blender calls handlers
    before it renders scene strips of the sequencer, but not before these.
    """
    found = [scene]
    if scene.render.use_compositing:
        tree = getattr(scene, "compositing_node_group", None) or getattr(scene, "node_tree", None)
        found += [other for other in _layers(tree, set()) if other != scene]
    return list(dict.fromkeys(drawn for each in found for drawn in (*homes(each), each)))


def _layers(tree, seen: set) -> list:
    """Scenes of the Render Layers nodes of a tree and of the groups in it."""
    if tree is None or tree.name_full in seen:
        return []
    seen.add(tree.name_full)
    found = []
    for node in tree.nodes:
        if node.bl_idname == "CompositorNodeRLayers" and node.scene is not None:
            found.append(node.scene)
        found += _layers(getattr(node, "node_tree", None), seen)
    return found
