# SPDX-License-Identifier: Apache-2.0
"""Which USD files this program wrote and may overwrite, and to which character they belong."""

from pxr import Sdf, Tf

from ..rig.stage import BAKED
from ..shot.bakes.bake_record import KEY
from .scene_writer import PLAYER, ROOT


def is_own(path) -> bool:
    """Whether a file is a bake, of strands or bones, or a shot that `scene_writer` wrote."""
    layer = _layer(path)
    if layer is None:
        return False
    found: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, found.append)
    prims = (layer.GetPrimAtPath(path) for path in found if path.IsPrimPath())
    return any(KEY in prim.customData or prim.name == BAKED for prim in prims)


def character_of(path) -> str:
    """The character whose shot a file is, by its name in the application; empty if the file does not say."""
    layer = _layer(path)
    prim = layer.GetPrimAtPath(ROOT) if layer else None
    return prim.GetInfo("displayName") if prim else ""


def player_of(path) -> str:
    """The file that plays the bake over the shot that a file is, relative to it; empty if the shot does not say."""
    layer = _layer(path)
    prim = layer.GetPrimAtPath(ROOT) if layer else None
    told = prim.customData.get(PLAYER, "") if prim else ""
    return told if isinstance(told, str) else ""


def _layer(path) -> Sdf.Layer | None:
    try:
        return Sdf.Layer.OpenAsAnonymous(str(path))
    except Tf.ErrorException:  # not a USD file, or a damaged one
        return None
