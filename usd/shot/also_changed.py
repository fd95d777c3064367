# SPDX-License-Identifier: Apache-2.0
"""Prims that a layer over the shot changes although nothing is written for them: those that reference or inherit a prim of the
shot that it overrides.
"""

from collections.abc import Iterable, Iterator

from pxr import Sdf, Usd


def also_changed(stage: Usd.Stage, prims: Iterable[Usd.Prim]) -> list[str]:
    """The notes on prims of the same type as one of these, and not among them, that take over what a layer says of it.

    Args:
        stage: the shot.
        prims: those that the layer is to override.
    """
    prims = list(prims)
    paths, kinds = {prim.GetPath() for prim in prims}, {prim.GetTypeName() for prim in prims}
    notes = []
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if prim.GetTypeName() in kinds and prim.GetPath() not in paths:
            source = next((path for path in _composed_of(prim, stage.GetRootLayer()) if path in paths), None)
            if source:
                notes.append(
                    f"{prim.GetPath()}: references or inherits {source} in this shot, so it changes as that is baked; bake both, "
                    "or make it a copy of its own"
                )
    return notes


def _composed_of(prim: Usd.Prim, root: Sdf.Layer) -> Iterator[Sdf.Path]:
    """The prims of the root layer and its sublayers that a prim is composed of."""
    while prim.IsInstanceProxy():
        prim = prim.GetPrimInPrototype()
    waiting = [prim.GetPrimIndex().rootNode]
    while waiting:
        node = waiting.pop()
        waiting += node.children
        if node.layerStack.identifier.rootLayer == root:
            yield node.path
