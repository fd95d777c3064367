# SPDX-License-Identifier: Apache-2.0
"""Prims that a layer over the shot changes although nothing is written for them: those that reference or inherit a prim of the
shot that it overrides, and those below an instance that the shot overrides in vain until the layer makes it a plain prim.
"""

from collections.abc import Iterable, Iterator

from pxr import Pcp, Sdf, Usd


def also_changed(prims: Iterable[Usd.Prim], every: Iterable[Usd.Prim]) -> list[str]:
    """The notes on prims that take over what a layer says of another one, or what a shot says below an instance.

    Args:
        prims: those that the layer is to override.
        every: all prims of the shot that are to be told of, these among them.
    """
    prims = list(prims)
    paths = {prim.GetPath() for prim in prims}
    notes = list(dict.fromkeys(note for prim in prims for note in _revived(prim)))
    for prim in every:
        if prim.GetPath() not in paths and (source := next((p for p in _composed_of(prim) if p in paths), None)):
            notes.append(
                f"{prim.GetPath()}: references or inherits {source} in this shot, so it changes as that is baked; bake both, or "
                "make it a copy of its own"
            )
    return notes


def _revived(prim: Usd.Prim) -> Iterator[str]:
    """A note for each instance around a prim below which the shot says something, which USD leaves out while it is an instance."""
    for above in prim.GetPath().GetPrefixes():
        instance = prim.GetStage().GetPrimAtPath(above)
        if not instance.IsInstance():
            continue
        for node in _nodes(instance):
            if node.parent and not node.IsDueToAncestor():
                continue  # what instances share
            for layer in node.layerStack.layers:
                if (spec := layer.GetPrimAtPath(node.path)) and (said := next(filter(_says, spec.nameChildren), None)):
                    yield (
                        f"{above}: is an instance, so what {layer.GetDisplayName()} says of prims below it ({said.path} ...) does not "
                        "count; it does in the bake, which makes it a plain prim: remove it from the layer if that is not meant"
                    )


def _says(spec: Sdf.PrimSpec) -> bool:
    """Whether a prim's spec, or one below it, says more than that the prim is there."""
    waiting = [spec]
    while waiting:
        spec = waiting.pop()
        if spec.specifier != Sdf.SpecifierOver or spec.properties or set(spec.ListInfoKeys()) - {"specifier"}:
            return True
        waiting += spec.nameChildren
    return False


def _composed_of(prim: Usd.Prim) -> Iterator[Sdf.Path]:
    """The prims of the root layer and its sublayers that a prim is composed of, by arcs of its own or of what it is in."""
    stage, path = prim.GetStage(), prim.GetPath()
    root = stage.GetRootLayer()
    for above in path.GetPrefixes():
        own = stage.GetPrimAtPath(above)
        while own.IsInstanceProxy():
            own = own.GetPrimInPrototype()
        for node in _nodes(own):
            # The first node of what instances share is at any one of them.
            if node.parent and not node.IsDueToAncestor() and node.layerStack.identifier.rootLayer == root:
                yield path.ReplacePrefix(above, node.path)


def _nodes(prim: Usd.Prim) -> Iterator[Pcp.NodeRef]:
    """All nodes of what a prim is composed of; the first one, its own, has no parent."""
    waiting = [prim.GetPrimIndex().rootNode]
    while waiting:
        node = waiting.pop()
        waiting += node.children
        yield node
