# SPDX-License-Identifier: Apache-2.0
"""Prims that a layer over the shot changes although nothing is written for them: those that reference or inherit a prim of the
shot that it overrides, and those below an instance that the shot overrides in vain until the layer makes it a plain prim.
"""

from collections.abc import Iterable, Iterator

from pxr import Sdf, Usd


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
    stage = prim.GetStage()
    for above in prim.GetPath().GetPrefixes():
        if stage.GetPrimAtPath(above).IsInstance():
            specs = [(layer, layer.GetPrimAtPath(above)) for layer in stage.GetLayerStack(includeSessionLayers=False)]
            for layer, spec in specs:
                if spec and spec.nameChildren:
                    yield (
                        f"{above}: is an instance, so what {layer.GetDisplayName()} says of prims below it "
                        f"({spec.nameChildren[0].path} ...) does not count; it does in the bake, which makes it a plain prim: remove it from "
                        "the layer if that is not meant"
                    )


def _composed_of(prim: Usd.Prim) -> Iterator[Sdf.Path]:
    """The prims of the root layer and its sublayers that a prim is composed of."""
    root = prim.GetStage().GetRootLayer()
    while prim.IsInstanceProxy():
        prim = prim.GetPrimInPrototype()
    waiting = [
        *prim.GetPrimIndex().rootNode.children
    ]  # the root is the prim, or the instance whose turn it is to stand for all
    while waiting:
        node = waiting.pop()
        waiting += node.children
        if node.layerStack.identifier.rootLayer == root:
            yield node.path
