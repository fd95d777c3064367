# SPDX-License-Identifier: Apache-2.0
"""Notes on a stage as a file: what USD could not compose, its unit, layers with unsaved changes."""

import os
from pathlib import Path

from pxr import Pcp, Usd, UsdGeom

from ...border.damage import text_of
from ...border.stage_files import unsaved
from ...border.units import Border

UNIT = UsdGeom.Tokens.metersPerUnit


def composition_notes(stage: Usd.Stage, path: Path) -> list[str]:
    """What USD could not compose: missing layers, for example."""
    return [f"{path.name}: {_told(error)}" for error in _composition_errors(stage)]


def uncomposed(stage: Usd.Stage) -> str:
    """What USD could not compose, as the likely cause if a stage lacks something, and the remedy; '' if it could compose all."""
    errors = _composition_errors(stage)
    if missing := _without_file(errors):
        fact = _told(missing[0]).removesuffix("; skipping.")
        return f"parts of it are missing or damaged ({fact}); add or repair the files that it refers to"
    return f"USD could not compose all of it ({_told(errors[0])}); repair that" if errors else ""


def layer_notes(stage: Usd.Stage, path: Path) -> list[str]:
    """Notes if a sublayer has another unit or axis than the shot's first layer, the only one from which USD reads them; and if no
    layer states the unit in effect, or how long a frame is.
    """
    border, layers = Border.of(stage), stage.GetLayerStack(includeSessionLayers=False)
    notes = border.frame_notes(path.name)
    for layer in layers[1:]:
        if differs := border.differing(layer):
            notes.append(
                f"{path.name}: its layer {layer.GetDisplayName()} {differs}: the first layer's count; author them there"
            )
            break
    return notes + unit_notes(stage, path)


def unit_notes(stage: Usd.Stage, path: Path) -> list[str]:
    """The note on a stage of which no layer states the unit in effect."""
    unit, layers = Border.of(stage).metres_per_unit, stage.GetLayerStack(includeSessionLayers=False)
    units = [layer.pseudoRoot.GetInfo(UNIT) for layer in stage.GetUsedLayers() if layer.pseudoRoot.HasInfo(UNIT)]
    if unit in units or any(layer.pseudoRoot.HasInfo(UNIT) for layer in layers):
        return []
    return [f"{path.name}: no metersPerUnit, so a unit counts as a centimetre; author it"]


def unsaved_notes(stage: Usd.Stage) -> list[str]:
    """The notes on layers of a shot with unsaved changes, so that another program reads a different shot."""
    names = sorted(layer.GetDisplayName() for layer in unsaved(stage) if layer.realPath)
    return [f"{name}: has unsaved changes, which this bake has in it; save it" for name in names]


def out_of_place(stage: Usd.Stage, out: Path) -> list[str]:
    """The note on a layer over a shot that cannot find, from its own folder, all files that the shot finds from its folder."""
    if os.path.realpath(out.parent) == os.path.dirname(os.path.realpath(stage.GetRootLayer().realPath)):
        return []
    found = {text_of(error) for error in _composition_errors(stage)}
    told = [text_of(error) for error in _without_file(_composition_errors(Usd.Stage.Open(str(out))))]
    lost = [text for text in told if text not in found]
    return [
        f"{out}: {' '.join(text.split())[:200].rstrip('.')}, which the shot finds from its own folder; write the bake there, or "
        "have USD search that folder (PXR_AR_DEFAULT_SEARCH_PATH)"
        for text in lost[:1]
    ]


def _told(error) -> str:
    return " ".join(text_of(error).split())[:200]


def _without_file(errors: list) -> list:
    """Those of files that cannot be read; others, such as of cycles, may name the stage's first layer."""
    kinds = Pcp.ErrorType_InvalidAssetPath, Pcp.ErrorType_InvalidSublayerPath
    return [error for error in errors if error.errorType in kinds]


def _composition_errors(stage: Usd.Stage) -> list:
    """Empty if USD does not report them, as in Blender 4.2 (USD 24.05)."""
    return stage.GetCompositionErrors() if hasattr(stage, "GetCompositionErrors") else []
