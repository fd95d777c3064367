# SPDX-License-Identifier: GPL-3.0-or-later
"""What a view layer shows, and so evaluates; and what is rendered."""

from .animated import animated


def enabled(thing, layer, mode: str = "VIEWPORT") -> bool:
    """Whether a view layer evaluates an object for itself. The eye in the outliner does not count: it only hides from view.

    Args:
        mode: as of a depsgraph, "VIEWPORT" or "RENDER", since things may be disabled in either.
    """
    if mode == "VIEWPORT" and thing.visible_get(view_layer=layer):
        return True
    off = "hide_render" if mode == "RENDER" else "hide_viewport"
    return not getattr(thing, off) and _within(layer.layer_collection, set(thing.users_collection), off)


def in_renders(thing, scene) -> bool:
    """Whether a render of the scene draws an object in any frame."""
    drawn = any(enabled(thing, layer, "RENDER") for layer in scene.view_layers if layer.use)
    return drawn or "hide_render" in animated(thing.animation_data)


def _within(branch, collections: set, off: str) -> bool:
    """Whether a branch of a view layer includes one of some collections; a child may be included while its parent is not."""
    if getattr(branch.collection, off):
        return False
    own = branch.collection in collections and not branch.exclude
    return own or any(_within(child, collections, off) for child in branch.children)
