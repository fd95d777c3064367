# SPDX-License-Identifier: Apache-2.0
"""USD files: opening them, refusing outputs that must not be overwritten, and writing them whole."""

import math
import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from pxr import Ar, Sdf, Tf, Usd

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path, atomic_write
from neuralocks_core.formats import EXTENSIONS
from neuralocks_core.models.model_file import SUFFIX as MODEL

from .damage import first_line, named
from .stopping import check

LAYERS = (".usd", ".usda", ".usdc")
USD = (*LAYERS, ".usdz")
GLTF = (".vrm", ".glb", ".gltf")
OTHERS = (".fbx", *GLTF, ".abc", ".blend")
"""Characters and hair in other formats, which USD reads only with plug-ins or not at all."""
LOWEST_RATE = 1e-100
"""Time codes per second of a layer, by which USD divides: far fewer would put its samples at infinity, as none do."""


def open_stage(path) -> Usd.Stage:
    """Open a USD file.

    Raises:
        NeuralocksError: it is missing, not a readable USD file, or one of its layers has samples and no rate.
    """
    path = as_path(path, "path")
    check_file(path)
    if path.suffix.lower() in EXTENSIONS:
        raise NeuralocksError(
            f"{path}: is a hair file; make a USD groom of it with 'neuralocks import' and add that to a shot"
        )
    if path.suffix.lower() == MODEL:
        raise NeuralocksError(
            f"{path}: is a trained model, not a scene; name a USD file here, and the model with --model"
        )
    check()  # USD swallows Ctrl-C while it loads its modules
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise NeuralocksError(f"{path}: not a readable USD file ({first_line(error)}); {_remedy(path)}") from None
    if stage is None:
        raise NeuralocksError(f"{path}: not a readable USD file; {_remedy(path)}")
    _check_rates(stage)
    return stage


def _check_rates(stage: Usd.Stage) -> None:
    """Refuse layers whose time samples, or those of layers in it, no stage can place in time: USD would search without end."""
    for layer in stage.GetUsedLayers():
        rate = layer.timeCodesPerSecond
        if not LOWEST_RATE < abs(rate) < math.inf and (
            layer.GetCompositionAssetDependencies() or layer.ListAllTimeSamples() or _has_clips(layer)
        ):
            name = layer.GetDisplayName()
            raise NeuralocksError(f"{name}: timeCodesPerSecond is {rate:g}; set it to the frame rate, such as 24")


def _has_clips(layer: Sdf.Layer) -> bool:
    """Whether a prim of the layer, or of a variant in it, takes its samples from other files."""
    found: list[Sdf.Path] = []

    def look(path: Sdf.Path) -> None:
        prim = layer.GetPrimAtPath(path)
        if prim and prim.HasInfo("clips"):
            found.append(path)

    layer.Traverse(Sdf.Path.absoluteRootPath, look)
    return bool(found)


def check_file(path: Path) -> None:
    """Refuse what is not a file.

    Raises:
        NeuralocksError: it is missing, a folder, or a pipe or device, which may never end.
    """
    if not path.exists():
        raise NeuralocksError(f"{path}: no such file; check the path")
    if path.is_dir():
        raise NeuralocksError(f"{path}: is a folder; name the USD file in it")
    if not path.is_file():
        raise NeuralocksError(f"{path}: is a pipe or a device; name a USD file")


def _remedy(path: Path) -> str:
    if path.suffix.lower() not in OTHERS:
        return "export it again"
    by = " (examples/vrm_to_usd.py in the source does)" if path.suffix.lower() in GLTF else ""
    first = "open it in Blender" if path.suffix.lower() == ".blend" else "import it into Blender"
    return f"{first} and export USD there{by}"


def used_files(stage: Usd.Stage) -> list[str]:
    """Files that the stage is composed of."""
    # Layers inside a package count as the package's file.
    paths = (layer.realPath for layer in stage.GetUsedLayers())
    return sorted({Ar.SplitPackageRelativePathOuter(path)[0] for path in paths if path})


def unsaved(stage: Usd.Stage) -> list[Sdf.Layer]:
    """Layers of the stage with unsaved edits: a host application keeps them in memory, and stages opened in it show them."""
    return [layer for layer in stage.GetUsedLayers() if not layer.empty and (layer.dirty or not layer.realPath)]


def check_layer_name(out: Path) -> None:
    """Refuse to write USD under a name that is not a USD layer's.

    Raises:
        NeuralocksError: it has another extension, is a folder's, or has a special meaning in USD.
    """
    if ":SDF_FORMAT_ARGS:" in str(out):
        raise NeuralocksError(f"{out}: USD reads what follows :SDF_FORMAT_ARGS: as arguments; choose another name")
    if out.suffix.lower() not in LAYERS:
        raise NeuralocksError(f"{out}: is written as a USD layer; end its name with {', '.join(LAYERS)}")
    if os.path.isdir(out):  # also False for a name too long for a file; writing it reports that
        raise NeuralocksError(f"{out}: is a folder; give a file name")


def check_not_input(out: Path, stage: Usd.Stage) -> None:
    """Refuse to write over a file that the stage is composed of, or may be: of another variant, of what is not loaded, or of a value
    clip at another time.

    Raises:
        NeuralocksError: `out` is one of them, under any name.
    """
    if any(one_file(out, path) for path in used_files(stage)):
        raise NeuralocksError(f"{out}: is read as well, as a file or a layer of it; choose another name")
    if not os.path.exists(out):  # a large layer takes half a second to tell what it refers to
        return
    for layer in stage.GetUsedLayers():
        for asset in layer.GetCompositionAssetDependencies():
            if one_file(out, layer.ComputeAbsolutePath(asset)):
                raise NeuralocksError(
                    f"{out}: {layer.GetDisplayName()} refers to it, as a layer or in a variant or payload; choose another name"
                )
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        if any(one_file(out, asset.resolvedPath) for asset in _clips(prim)):
            raise NeuralocksError(f"{out}: is a value clip of {prim.GetPath()}; choose another name")


def _clips(prim: Usd.Prim) -> Iterator[Sdf.AssetPath]:
    """The files that a prim's value clips are in, opened or not; none if what names them is damaged, as USD plays none then."""
    clips = Usd.ClipsAPI(prim)
    sets = clips.GetClips() if prim.HasMetadata("clips") else {}
    for name in sets:
        with suppress(Tf.ErrorException):
            yield from clips.ComputeClipAssetPaths(name)


def check_not_over(out: Path, stage: Usd.Stage) -> None:
    """Refuse to write a layer over a shot under the name of what is part of that shot, or will be once it is there.

    Raises:
        NeuralocksError: `out` is one of its files, or the name of a missing one of its layers.
    """
    check_not_input(out, stage)
    for layer in stage.GetUsedLayers():
        folder = os.path.dirname(layer.realPath)
        named_there = [os.path.realpath(os.path.join(folder, name)) for name in layer.subLayerPaths if folder]
        if os.path.realpath(out) in named_there:
            raise NeuralocksError(
                f"{out}: {layer.GetDisplayName()} has it as a layer, and what is written lies over that file; take it out there, "
                "or choose another name"
            )


def one_file(out: Path, path: str | Path) -> bool:
    """Whether a file to be written is a given existing one; folders in its path may still be missing."""
    if not os.path.exists(path):
        return False
    return os.path.realpath(out) == os.path.realpath(path) or (os.path.exists(out) and os.path.samefile(out, path))


def write_stage(
    path: Path, author: Callable[[Usd.Stage], None], finish: Callable[[Sdf.Layer], None] | None = None
) -> Path:
    """Write a new USD file with what `author` puts into the stage; it gets its final name when it is complete.

    `finish` gets the layer when no stage composes it any more: until then, relative paths of sublayers lead nowhere.

    Raises:
        NeuralocksError: the path has another extension, or cannot be written.
    """
    check_layer_name(path)
    with named(path), atomic_write(path) as part:
        stage = Usd.Stage.CreateNew(str(part))
        author(stage)
        stage.GetRootLayer().Save()
        del stage
        if finish:
            layer = Sdf.Layer.FindOrOpen(str(part))
            finish(layer)
            layer.Save()
            del layer
        check()
    refresh_open(path)
    return path


def refresh_open(path: Path) -> None:
    """Let stages that this process has open, or opens later, see a rewritten file: USD keeps a layer while anybody holds it."""
    layer = Sdf.Layer.Find(os.path.realpath(path)) or Sdf.Layer.Find(str(path))
    if layer:
        layer.Reload(force=True)
