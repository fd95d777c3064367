# SPDX-License-Identifier: Apache-2.0
"""Prims that a layer over the shot changes although nothing is written for them: those that reference or inherit a prim of the
shot that it overrides.
"""

from collections.abc import Iterable, Iterator

from pxr import Sdf, Usd


def also_changed(prims: Iterable[Usd.Prim], every: Iterable[Usd.Prim]) -> list[str]:
    """The notes on prims that take over what a layer says of another one.

    Args:
        prims: those that the layer is to override.
        every: all prims of the shot that are to be told of, these among them.
    """
    paths, notes = {prim.GetPath() for prim in prims}, []
    for prim in every:
        if prim.GetPath() not in paths and (source := next((p for p in _composed_of(prim) if p in paths), None)):
            notes.append(
                f"{prim.GetPath()}: references or inherits {source} in this shot, so it changes as that is baked; bake both, or "
                "make it a copy of its own"
            )
    return notes


def _composed_of(prim: Usd.Prim) -> Iterator[Sdf.Path]:
    """The prims of the root layer and its sublayers that a prim is composed of."""
    root = prim.GetStage().GetRootLayer()
    while prim.IsInstanceProxy():
        prim = prim.GetPrimInPrototype()
    waiting = [prim.GetPrimIndex().rootNode]
    while waiting:
        node = waiting.pop()
        waiting += node.children
        if node.layerStack.identifier.rootLayer == root:
            yield node.path
