# SPDX-License-Identifier: Apache-2.0
"""`neuralocks preview`: a picture strip or a clip of a bake, of strands or of mesh hair."""

from pathlib import Path

from neuralocks_core import preview as drawing

from .baked import Baked, read_baked
from .border import open_stage
from .curves import find_curves
from .damage import names_damage
from .rig_picture import rigged_scene
from .rig_stage import read_rigged_hair


@names_damage
def preview(baked, path, *, grooms=None, skeleton=None, head=None, size=None, progress=None) -> Path:
    """Draw a bake without a display; mesh hair on joints where the stage has no strands.

    Args:
        baked: path of the bake, or a `Baked` already read.
        path: .png for a strip of pictures, .mp4 or .gif for a clip.
        grooms, skeleton, head: as for `bake`.
        size: width and height of one picture in pixels.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: the file is no bake, or the picture cannot be made.
    """
    if isinstance(baked, Baked) or find_curves(open_stage(baked), grooms):
        baked = baked if isinstance(baked, Baked) else read_baked(baked, grooms, skeleton, head)
        scene, border = baked.scene(), baked.shot.border
    else:
        rigged = read_rigged_hair(baked, skeleton=skeleton, head=head)
        scene, border = rigged_scene(rigged), rigged.border
    return drawing.render(scene, path, size=size, rate=min(border.rate / border.frame, 30.0), progress=progress)
