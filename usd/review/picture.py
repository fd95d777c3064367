# SPDX-License-Identifier: Apache-2.0
"""`neuralocks preview`: a picture strip or a clip of a bake, of strands or of mesh hair; of a groom, how it looks on the head."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from neuralocks_core.arguments import flag
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path
from neuralocks_core.preview import pictures as drawing
from neuralocks_core.preview.film import AZIMUTH
from neuralocks_core.progress import Progress
from neuralocks_core.rig.chain_finding import NoHairChains

from ..border.amounts import check_number
from ..border.damage import names_damage
from ..border.stage_files import open_stage
from ..border.stopping import deferred
from ..border.time_codes import parse_frames, time_codes
from ..border.told_once import few
from ..border.units import Border
from ..rig.picture import rigged_scene
from ..rig.stage import read_rigged_hair
from ..shot.strands.curves import find_curves
from .baked import MOST_BODY_POINTS, Baked, NotBaked, read_baked
from .unbaked import as_groomed

SIDES = 16, 4096
"""Least and largest width and height of a picture [pixels]."""


@names_damage
def preview(
    baked,
    path,
    *,
    grooms=None,
    skeleton=None,
    head=None,
    frames: str | None = None,
    size: tuple[int, int] | None = None,
    view: float = AZIMUTH,
    turntable: bool = False,
    tell: Callable[[list[str]], None] | None = None,
    progress: Progress | None = None,
) -> Path:
    """Draw a bake without a display; mesh hair on joints where the stage has no strands; hair that is not baked as it was groomed, in
    the first frame if none is named.

    Args:
        baked: path of the bake, or of a groom with its character, or a `Baked` already read.
        path: .png for a strip of pictures, .mp4 or .gif for a clip.
        grooms, skeleton, head: as for `bake`.
        frames: in time codes, for a strip `FIRST:LAST[:STEP]`, of which it shows six if they are more than twelve, for a clip
            `FIRST:LAST`; if left out, a strip shows six of all frames, a clip all.
        size: width and height of one picture in pixels, such as (440, 620).
        view: where the camera is: degrees from the face to the character's left.
        turntable: whether the camera goes round once.
        tell: called with notes on what is not drawn.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: the file has no hair on a character, an argument cannot be used, or the picture cannot be made.
    """
    _check_size(size)
    check_number("--view", view, -360, 360)
    turntable = flag("--turntable", turntable)
    if isinstance(baked, Baked):
        scene, border = _strands(baked, tell)
    else:
        try:
            scene, border = _scene(baked, grooms, skeleton, head, tell)
        except NotBaked as error:
            scene, border = _strands(as_groomed(error.shot, first_alone=frames is None), tell)
            if tell:
                tell([f"{baked}: its hair is not baked, so it is drawn as it was groomed, stiff on the head"])
    with deferred():  # drawing may load modules at any time; progress checks after each picture
        return drawing.render(
            scene,
            path,
            size=size,
            frames=_samples(frames, scene.times, border, as_path(path, "path")),
            azimuth=view,
            turntable=turntable,
            rate=min(border.rate / border.frame, 30.0),
            name=lambda time: f"frame {border.time_codes(time).round(3):g}",
            progress=progress,
        )


def _check_size(size) -> None:
    if size is None:
        return
    if not isinstance(size, tuple | list) or len(size) != 2:
        raise NeuralocksError(f"--size {size!r}: must be width and height in pixels, such as (440, 620)")
    for side in size:
        check_number("--size", side, *SIDES, whole=True)


def _samples(frames: str | None, times: np.ndarray, border: Border, path: Path) -> np.ndarray | None:
    """Numbers of the samples at `times` [s] that are nearest to the frames asked for, ascending; None for all."""
    if frames is None:
        return None
    clip = path.suffix.lower() in drawing.CLIPS
    if clip and isinstance(frames, str) and parse_frames(frames, border.frame)[2] != border.frame:
        raise NeuralocksError(f"--frames {frames}: a clip plays in real time; leave out STEP, or write a strip, a .png")
    first, last = border.time_codes(times[[0, -1]])
    wanted = np.array(time_codes(frames, first, last, frame=border.frame))
    if wanted[0] < first - border.frame / 2 or wanted[-1] > last + border.frame / 2:
        raise NeuralocksError(f"--frames {frames}: its frames are {first:g} to {last:g}; choose from these")
    return np.unique(drawing.nearest(times, border.seconds(wanted)))


def _strands(baked: Baked, tell) -> tuple[drawing.Scene, Border]:
    scene, notes = baked.scene(), []
    drawn = baked.shown[0].attachment.rig.path
    rigs = {item.attachment.rig.path: item.attachment.rig for item in baked.shot.grooms}
    notes += _undrawn(drawn, [path for path, rig in rigs.items() if not baked.is_first(rig)])
    notes += few(baked.broken(baked.drawn), "grooms lack frames")
    if scene.body is None and (body := baked.shown[0].attachment.character.body) is not None:
        notes.append(
            f"{drawn}: its body has {len(body.points)} points, more than {MOST_BODY_POINTS}, so only its hair is drawn"
        )
    if tell and notes:
        tell(notes)
    return scene, baked.shot.border


def _scene(path, grooms, skeleton, head, tell) -> tuple[drawing.Scene, Border]:
    """Strands where any move, else mesh hair: a character with mesh hair may have brows, or stand on grass."""
    try:
        return _strands(read_baked(path, grooms, skeleton, head), tell)
    except NeuralocksError as error:
        no_strands = error
    try:
        rigged = read_rigged_hair(path, skeleton=skeleton, head=head, baked_first=True)
    except NoHairChains:
        if find_curves(open_stage(path), grooms):
            raise no_strands from None
        raise NeuralocksError(f"{path}: holds no groom and no hair chains; give a bake") from None
    except NeuralocksError as error:
        raise (no_strands if find_curves(open_stage(path), grooms) else error) from None
    scene = rigged_scene(rigged)
    if tell and (notes := _undrawn(rigged.path, rigged.others)):
        tell(notes)
    return scene, rigged.stage_rig.border


def _undrawn(drawn: str, others: Sequence[str]) -> list[str]:
    """The note on characters whose hair is not drawn."""
    if not others:
        return []
    return [
        f"{drawn}: one of {1 + len(others)} characters is drawn; choose another, such as {others[0]}, with --skeleton PRIM"
    ]
