# SPDX-License-Identifier: Apache-2.0
"""`neuralocks import`: hair files of other tools as USD grooms, as they are or put on a character's head."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from pxr import Sdf, UsdGeom, Vt

from neuralocks_core.arguments import flag
from neuralocks_core.deformation.freeing import freed
from neuralocks_core.errors import NeuralocksError, about
from neuralocks_core.files import as_path, check_writable
from neuralocks_core.formats.look import Look
from neuralocks_core.groom import Groom
from neuralocks_core.hairstyles.fitting import sized
from neuralocks_core.progress import Progress, silent, within

from ..baking.points.undrawn_points import UndrawnPoints
from ..border.stage_files import OTHERS, USD, check_layer_name
from ..skel.stage_rig import StageRig
from .curve_primvars import Beside, Primvar
from .groom import Authored, write_grooms
from .grow import Barber, whose_head
from .usd_hair import read_usd

_READ, _LAID = 400, 950
"""Progress, in thousandths of the work, once the files are read and once the hair is on the head and out of the body."""
_OFF = 0.1
"""A larger share of roots off the scalp is told: a hairline that is lower than another's has a hundredth."""


def import_groom(
    source,
    out,
    unit: str | float | None = None,
    up: str | None = None,
    *,
    character=None,
    grooms=None,
    skeleton: str | None = None,
    head: str | None = None,
    with_character: bool = False,
    replaced=None,
    progress: Progress | None = None,
) -> tuple[list[Groom], list[str]]:
    """Read hair files (TressFX, .hair, .data, .bin, USD curves) and write them as USD grooms.

    Args:
        source: a hair file, or several with parts of one head of hair.
        out: USD file to write: in metres, Y up, or in the unit and axis of the character's file.
        unit: "mm", "cm", "in", "m" or metres per unit of the source; if left out, what the file says, or what suits a head.
        up: "Y" or "Z", the source's upward axis.
        character: USD file of a character, on whose head the hair is put: upright hair that faces forward, anywhere. If no unit is
            given, it gets the head's size, too.
        grooms: prim paths of the wanted grooms of USD files; all hair if left out.
        skeleton, head: as for `bake`, of the character on whose head the hair is put.
        with_character, replaced: as for `grow`.
        progress: called with (done, total, message).

    Returns:
        The grooms, and what a user should know.

    Raises:
        NeuralocksError: the source cannot be read, the target cannot be written, or the character has no head with skin.
    """
    sources = [as_path(each, "source") for each in (source if isinstance(source, list | tuple) else [source])]
    if not sources:
        raise NeuralocksError("source: is an empty list; name the hair files to import")
    out, rig, over, notes, found = as_path(out, "out"), None, None, [], []
    check_layer_name(out)
    with_character = flag("--with-character", with_character)
    given = {"with-character": with_character, "skeleton": skeleton, "head": head, "replace": replaced}
    for option, value in given.items():
        if value and character is None:
            raise NeuralocksError(f"--{option}: there is no character; name one with --character")
    if grooms and not any(path.suffix.lower() in (*USD, *OTHERS) for path in sources):
        raise NeuralocksError("--groom: only USD files have prims; leave it out")
    check_writable(out)
    say = progress or silent
    if character is not None:
        say(0, 1000, "looking at the head")
        rig, over, notes = whose_head(character, skeleton, head, out, with_character, replaced)
    counted, told = (unit, []) if unit is not None else _common_unit(sources, rig is not None)
    notes += told
    for number, path in enumerate(sources):
        say((_READ if rig else _LAID) * number // len(sources), 1000, f"reading {path.name}")
        read, told = _read(path, out, counted, up, grooms, rig is not None and unit is None, rig is not None)
        found += read
        notes += told
    if rig:
        subject = ", ".join(map(str, sources))
        with about(subject):
            found, told, elsewhere = _put_on(rig, found, unit is None, within(say, _READ, _LAID))
        notes += [f"{subject}: {told}", *elsewhere]
    say(_LAID, 1000, f"writing {out.name}")
    write_grooms(out, found, rig, over)
    return [each.groom for each in found], notes


def _common_unit(sources: list[Path], sized: bool) -> tuple[float | None, list[str]]:
    """One unit for all parts of a head, if they leave it open, and the note on it; None to let each file's reader find it, and tell. Where
    a head sizes the hair, it need not be told.
    """
    if len(sources) < 2 and not sized or any(path.suffix.lower() in (*USD, *OTHERS) for path in sources):
        return None, []
    from neuralocks_core import formats

    return formats.common_unit(sources, sized)


def _read(source: Path, out: Path, unit, up, grooms, sized: bool, onto: bool) -> tuple[list[Authored], list[str]]:
    """The grooms of a file, and what a user should know; `sized` if a head sizes them, `onto` if they are put on one."""
    if source.suffix.lower() in (*USD, *OTHERS):
        return read_usd(source, out, unit, up, grooms, sized, onto)
    from neuralocks_core import formats

    groom, look, notes = formats.read_with_look(source, unit, up)
    return [Authored(groom, beside=Beside(_primvars(look)))], notes


def _put_on(rig: StageRig, found: list[Authored], resize: bool, say: Progress) -> tuple[list[Authored], str, list[str]]:
    """The hair on a character's head and out of its body, in bind world; how it was put there; notes on roots off the scalp."""
    say(0, len(found), "putting it on the head")
    drawn = [each.groom if each.beyond is None else each.beyond.left_out(each.groom) for each in found]
    fitted, on, laid = Barber(rig.character).fitted(drawn, resize), [], []
    for number, (each, groom) in enumerate(zip(found, fitted.grooms)):
        say(number, len(found), f"taking {groom.name} out of the body")
        groom, moved = freed(groom, rig.character)
        if each.beyond is not None:
            groom = _with_ends(each, groom, fitted.scale, rig.character.facing)
        on.append(replace(each, groom=groom))
        laid.append(moved)
    laid = np.concatenate(laid)
    size = f", made {fitted.scale:.3g} times as large" if resize else ""
    middle, most = 1e3 * np.median(fitted.moved), 1e3 * fitted.moved.max()
    told = (
        f"put on the head of {rig.path}{size}; strands were moved by {middle:.0f} mm in the median, {most:.0f} mm at most, "
        "so that their roots lie on its skin"
    )
    if (laid > 1e-3).any():
        told += f", and {(laid > 1e-3).sum()} that went into the body were laid over it, by {1e3 * laid.max():.0f} mm at most"
    elsewhere = [
        f"{each.groom.name}: {100 * off:.0f}% of its roots lie off the scalp, on the face, the neck or the body; if they do not "
        "belong there, turn the hair to face forward (+Z if Y is up, -Y if Z is), check --up, import it together with the other "
        "parts of that hair, or reverse its strands if they run from tip to root"
        for each, off in zip(found, fitted.off)
        if off > _OFF
    ]
    return on, told, elsewhere


def _with_ends(each: Authored, drawn: Groom, scale: float, facing: np.ndarray) -> Groom:
    """All points of curves whose drawn ones are on a head, made `scale` times as large: those beyond the ends go with them."""
    points = np.empty_like(each.groom.points)
    UndrawnPoints(each.beyond, each.groom.points, scale * facing.T).put(drawn.points, 0, np.eye(3), None, points)
    return replace(each.groom, points=points, widths=sized(each.groom.widths, scale))


def _primvars(look: Look) -> tuple[Primvar, ...]:
    """Colours as primvars that renderers and viewports know."""
    names, found = Sdf.ValueTypeNames, []
    for name, kind, values, array in (
        ("displayColor", names.Color3fArray, look.color, Vt.Vec3fArray),
        ("displayOpacity", names.FloatArray, look.opacity, Vt.FloatArray),
    ):
        if values is not None:
            scope = UsdGeom.Tokens.constant if len(values) == 1 else UsdGeom.Tokens.vertex
            found.append(Primvar(name, kind, scope, 1, array.FromNumpy(np.ascontiguousarray(values))))
    return tuple(found)
