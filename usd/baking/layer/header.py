# SPDX-License-Identifier: Apache-2.0
"""How every layer over a shot begins: the shot as sublayer, metadata that USD reads only from the first layer, and overs."""

import os
import unicodedata
from pathlib import Path

from pxr import Sdf, Usd, UsdUtils

from neuralocks_core.errors import NeuralocksError

from ...border.units import Border

LAYERS_OWN = {"subLayers", "subLayerOffsets", "layerRelocates", "comment", "documentation", "owner", "sessionOwner"}
"""Metadata of a single layer, or that USD also reads from sublayers."""
RANGE = "startTimeCode", "endTimeCode"


def write_header(layer: Sdf.Layer, stage: Usd.Stage, border: Border, shot: Path, out: Path, codes: list[float]) -> None:
    """Sublayer the shot by a path relative to `out`, and repeat what USD reads from a stage's first layer only."""
    said = {name: stage.GetMetadata(name) for name in RANGE if stage.HasAuthoredMetadata(name)}  # perhaps one of both
    facts = {
        "metersPerUnit": border.metres_per_unit,
        "upAxis": border.up_axis,
        "timeCodesPerSecond": border.rate,
        "framesPerSecond": stage.GetFramesPerSecond(),
        "startTimeCode": min(codes[0], said.get("endTimeCode", codes[0])),
        "endTimeCode": max(codes[-1], said.get("startTimeCode", codes[-1])),
    } | said
    if not stage.GetDefaultPrim():  # otherwise it is repeated as the shot has it, which may be a path
        facts["defaultPrim"] = next(iter(stage.GetPseudoRoot().GetChildren())).GetName()
    repeat_metadata(stage.GetRootLayer(), layer, out, facts)
    layer.subLayerPaths.append(relative(shot, out))


def repeat_metadata(source: Sdf.Layer, layer: Sdf.Layer, out: Path, facts: dict) -> None:
    """Copy units, rates, range, default prim, render settings and the variables that references need; `facts` override them."""
    root = source.pseudoRoot
    said = {name: root.GetInfo(name) for name in root.ListInfoKeys() if name not in LAYERS_OWN}
    for name, value in sorted((said | facts).items()):  # USD's own order differs between processes
        layer.pseudoRoot.SetInfo(name, value)

    def placed(asset: str) -> str:
        return relative(source.ComputeAbsolutePath(asset), out) if asset.startswith(("./", "../")) else asset

    UsdUtils.ModifyAssetPaths(layer, placed)


def relative(file, out: Path) -> str:
    """Path of a file relative to a layer's folder, by the names given: links stay links.

    USD resolves a shot's references from the shot's own folder, not from where a link in its path leads. If the folder's own path
    contains a link, `..` must lead to the file both from the link and from its target.

    Raises:
        NeuralocksError: the file's path has a control character, or the layer's a backslash that USD would read as a slash.
    """
    if any(unicodedata.category(letter) == "Cc" for letter in str(file)):
        raise NeuralocksError(
            f"{file}: its path holds a control character such as a line break, which no layer can name; rename it"
        )
    if os.sep == "/" and "\\" in os.path.abspath(out):
        raise NeuralocksError(
            f"{out}: USD reads the backslash in its path as a slash and does not find the shot; rename it"
        )
    folder, behind = out.parent, os.path.realpath(out.parent)
    try:
        ways = [
            os.path.relpath(os.path.abspath(file), os.path.abspath(folder)),
            os.path.relpath(os.path.realpath(file), behind),
        ]
    except ValueError:  # another drive
        return os.path.realpath(file).replace(os.sep, "/")
    leading = (way for way in ways if all(_same(f"{start}/{way}", file) for start in (os.path.abspath(folder), behind)))
    relative = next(leading, ways[0]).replace(os.sep, "/")
    return relative if relative.startswith("../") else f"./{relative}"


def over_prim(layer: Sdf.Layer, prim: Usd.Prim) -> Sdf.PrimSpec:
    """The over of a shot's prim. Instances around it become plain prims: nothing inside an instance can be overridden."""
    for above in prim.GetPath().GetPrefixes():
        if prim.GetStage().GetPrimAtPath(above).IsInstance():
            _over(layer, above).instanceable = False
    return _over(layer, prim.GetPath())


def apply_binding(over: Sdf.PrimSpec, prim: Usd.Prim) -> None:
    """Apply SkelBindingAPI to an over whose prim does not have it."""
    if not prim.HasAPI("SkelBindingAPI"):
        over.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["SkelBindingAPI"]))


def _same(path: str, file) -> bool:
    """Whether a path is the file, read as USD reads it, without resolving links before `..`."""
    try:
        return os.path.samefile(os.path.normpath(path), file)
    except OSError:
        return False


def _over(layer: Sdf.Layer, path: Sdf.Path) -> Sdf.PrimSpec:
    return layer.GetPrimAtPath(path) or Sdf.CreatePrimInLayer(layer, path)
