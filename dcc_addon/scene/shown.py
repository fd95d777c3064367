# SPDX-License-Identifier: GPL-3.0-or-later
"""What a view layer shows, and so evaluates; and what is rendered."""

from collections.abc import Iterator

from .animated import animated


def enabled(thing, layer, mode: str = "VIEWPORT") -> bool:
    """Whether a view layer evaluates an object for itself. The eye in the outliner does not count: it only hides from view.

    Args:
        mode: as of a depsgraph, "VIEWPORT" or "RENDER", since things may be disabled in either.
    """
    if mode == "VIEWPORT" and thing.visible_get(view_layer=layer):
        return True
    off = "hide_render" if mode == "RENDER" else "hide_viewport"
    held = set(thing.users_collection)
    return not getattr(thing, off) and any(each in held for each in _included(layer.layer_collection, off))


def in_renders(scene) -> set:
    """Objects that a render of the scene draws in any frame. All at once, because it takes as long to find the collections of one."""
    roots = (layer.layer_collection for layer in scene.view_layers if layer.use)
    drawn = {each for root in roots for each in _included(root, "hide_render")}
    of = (thing for each in drawn for thing in each.objects)
    return {thing for thing in of if not thing.hide_render or "hide_render" in animated(thing.animation_data)}


def _included(branch, off: str) -> Iterator:
    """Collections that a branch of a view layer includes; a child may be included while its parent is not."""
    if not getattr(branch.collection, off):
        if not branch.exclude:
            yield branch.collection
        for child in branch.children:
            yield from _included(child, off)
