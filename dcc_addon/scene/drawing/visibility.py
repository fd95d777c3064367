# SPDX-License-Identifier: GPL-3.0-or-later
"""What a view layer shows, and so evaluates; and what is rendered."""

from collections.abc import Iterator

from ..objects.animated import animated


def enabled(thing, layer, mode: str = "VIEWPORT") -> bool:
    """Whether a view layer evaluates an object for itself. The eye in the outliner does not count: it only hides from view.

    Args:
        mode: as of a depsgraph, "VIEWPORT" or "RENDER", since things may be disabled in either.
    """
    if mode == "VIEWPORT" and thing.visible_get(view_layer=layer):
        return True
    off = "hide_render" if mode == "RENDER" else "hide_viewport"
    return not getattr(thing, off) and _linked(thing, [layer], off)


def in_renders(thing, scene) -> bool:
    """Whether a render of the scene draws an object in any frame; of a scene of which nothing is rendered, if that would be on."""
    layers = [layer for layer in scene.view_layers if layer.use] or scene.view_layers
    drawn = not thing.hide_render or "hide_render" in animated(thing.animation_data)
    return drawn and _linked(thing, layers, "hide_render")


def homes_of(thing, context) -> list:
    """The collections in which a new object appears wherever a thing does: the thing's own in this scene; also the scene's, if none of
    them is in view, or all belong to other files.
    """
    scene, layer = context.scene.collection, context.view_layer.layer_collection
    here = {scene, *scene.children_recursive}
    own = [each for each in thing.users_collection if each in here and not (each.library or each.override_library)]
    return own if {*own} & {*_included(layer, "hide_viewport")} else [*own, scene]


def _linked(thing, layers, off: str) -> bool:
    held = set(thing.users_collection)
    return any(each in held for layer in layers for each in _included(layer.layer_collection, off))


def _included(branch, off: str) -> Iterator:
    """Collections that a branch of a view layer includes; a child may be included while its parent is not."""
    if not getattr(branch.collection, off):
        if not branch.exclude:
            yield branch.collection
        for child in branch.children:
            yield from _included(child, off)
