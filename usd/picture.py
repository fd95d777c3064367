# SPDX-License-Identifier: Apache-2.0
"""`neuralocks preview`: a picture strip or a clip of a bake."""

from pathlib import Path

from neuralocks_core import preview as drawing

from .baked import Baked, read_baked
from .damage import names_damage


@names_damage
def preview(baked, path, *, grooms=None, skeleton=None, head=None, size=None, progress=None) -> Path:
    """Draw a bake without a display.

    Args:
        baked: path of the bake, or a `Baked` already read.
        path: .png for a strip of pictures, .mp4 or .gif for a clip.
        grooms, skeleton, head: as for `bake`.
        size: width and height of one picture in pixels.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: the file is no bake, or the picture cannot be made.
    """
    if not isinstance(baked, Baked):
        baked = read_baked(baked, grooms, skeleton, head)
    rate = min(baked.shot.border.rate, 30.0)
    return drawing.render(baked.scene(), path, size=size, rate=rate, progress=progress)
