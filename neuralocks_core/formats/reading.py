# SPDX-License-Identifier: Apache-2.0
"""Reading a groom file of any kind, in metres, Y up."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.formats import cemyuksel, counted, tressfx, tressfx_text
from neuralocks_core.formats.look import Look, checked_look
from neuralocks_core.formats.raw import RawGroom, bad_file
from neuralocks_core.formats.units import UNITS, metres_per_unit, upward_axis
from neuralocks_core.groom import LARGEST_COORDINATE, Groom
from neuralocks_core.strands.arclength import count_pointlike

EXTENSIONS = (".tfx", ".hair", ".data", ".bin")
"""Extensions that `read` knows; content that identifies its format takes precedence."""

LARGEST_FILE = 4 * 2**30
"""Bytes; a groom of a million strands of 100 vertices has a third of this."""

PACKED = {
    b"\x1f\x8b\x08": "gzip",
    b"PK\x03\x04": "zip",
    b"BZh": "bzip2",
    b"\xfd7zXZ": "xz",
    b"\x28\xb5\x2f\xfd": "zstd",
}
"""First bytes of compressed files, none of which is read."""
PACKED_NAMES = ("", *EXTENSIONS, ".gz", ".zip", ".bz2", ".xz", ".zst")
"""Extensions of compressed grooms: many other files are compressed too, such as a model."""

SCALP = 0.16
"""Width of a narrow scalp [m]."""
NARROW, WIDE = 0.1, 0.3
"""Widths [m] below and above which a note says that a scalp is not a person's: the hair may be a part of a head's, or have
another unit than the one assumed.
"""

WIDEST = 0.005
"""A hair wider than this [m] means that the file's thickness is in another unit than its points."""


def read(path: str | Path, unit: str | float | None = None, up: str | None = None) -> Groom:
    """The groom in a TressFX, Cem Yuksel, USC-HairSalon or CT2Hair file.

    Args:
        path: the file; its stem becomes the name of the groom.
        unit: metres per unit of the file, or "mm", "cm", "m", "in"; left out, the unit that the format
            prescribes, else the one of mm, cm and m that suits a human scalp.
        up: "Y" or "Z", the file's upward axis; left out, the one usual for the format.

    Raises:
        NeuralocksError: the file cannot be read, is truncated or malformed, or holds no usable groom.
    """
    return read_with_notes(path, unit, up)[0]


def read_with_notes(
    path: str | Path, unit: str | float | None = None, up: str | None = None
) -> tuple[Groom, list[str]]:
    """The same as `read`, with its errors, and one line for each thing that was assumed or left out."""
    groom, _, notes = read_with_look(path, unit, up)
    return groom, notes


def read_with_look(
    path: str | Path, unit: str | float | None = None, up: str | None = None
) -> tuple[Groom, Look, list[str]]:
    """The same as `read_with_notes`, and the file's colours."""
    path = Path(path)
    wanted = None if unit is None else metres_per_unit(unit)
    wanted_axis = None if up is None else upward_axis(up)
    content = _content(path)
    raw = _raw(path, content)
    if not len(raw.points):
        raise bad_file(str(path), "holds no points", "export one with hair in it")
    notes = list(raw.notes)
    points = raw.points.astype(np.float32, copy=False)
    _check_finite(points, path)

    scale = wanted
    if scale is None:
        scale, told = _own_unit(raw, points, path)
        notes += told
    axis = wanted_axis or raw.up
    with np.errstate(over="ignore", invalid="ignore"):  # overflow and NaN are handled below
        points = points * np.float32(scale)
        widths = None if raw.widths is None else raw.widths.astype(np.float32) * np.float32(scale)
    if axis == "Z":
        points = np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)

    if widths is not None and not ((widths >= 0).all() and 0 < widths.max(initial=0.0) <= WIDEST):
        notes.append(f"{path}: its thickness is not that of hair; took 0.08 mm")
        widths = None
    root_uv = raw.root_uv
    if root_uv is not None and not np.isfinite(root_uv).all():
        notes.append(f"{path}: its strand texture coordinates are not finite; left out")
        root_uv = None
    if not (np.abs(points) <= LARGEST_COORDINATE).all():
        raise bad_file(str(path), f"points lie farther than {LARGEST_COORDINATE:g} m from the origin", "check --unit")
    groom = Groom(path.stem or "groom", points, raw.counts, widths, root_uv)
    look, told = checked_look(raw.color, raw.transparency, str(path))
    notes += told
    still = count_pointlike(groom)
    if still:
        fact = f"{still} of {groom.strand_count} strands have no two distinct points"
        notes.append(f"{path}: {fact}; they are kept, but will not move on their own")
    return groom, look, notes


def common_unit(paths: Sequence[str | Path], sized: bool = False) -> tuple[float | None, list[str]]:
    """The unit [m] that suits the roots of several files with parts of one head of hair, and the note that it was assumed; None if one of
    them has a unit of its own, or if their roots tell nothing.

    Args:
        paths: the files.
        sized: the hair gets the size of a head anyway, so that a unit which all of them have, right or wrong, does not matter, and no
            note is needed.

    Raises:
        NeuralocksError: as `read`.
    """
    roots, units = [], set()
    for path in map(Path, paths):
        raw = _raw(path, _content(path))
        units.add(raw.unit)
        roots.append(_roots(raw, raw.points))
    if len(units) > 1 or units != {None} and not sized:
        return None, []
    scalp = _scalp(np.concatenate(roots))
    if not 0 < scalp < np.inf:
        return None, []
    unit = _likely_unit(scalp)
    return unit, [] if sized else [_unstated(", ".join(map(str, paths)), "do not state their unit", scalp, unit)]


def _content(path: Path) -> bytes:
    try:
        if not path.is_file():
            fact = "is not a file" if path.exists() else "there is no such file"
            raise NeuralocksError(f"{path}: {fact}; give a groom file ({' '.join(EXTENSIONS)}, or USD curves)")
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise bad_file(str(path), f"has {size} bytes, more than the {LARGEST_FILE} that are read", "split it")
        return path.read_bytes()
    except NeuralocksError:
        raise
    except (OSError, ValueError, MemoryError) as error:
        raise bad_file(str(path), f"cannot be read ({error})", "check the path and its permissions") from None


def _raw(path: Path, content: bytes) -> RawGroom:
    try:
        return _reader(path, content)(content, str(path))
    except NeuralocksError:
        # Checked only now: the files of this format begin with a number, which may be any number.
        packed = next((name for begin, name in PACKED.items() if content.startswith(begin)), None)
        if packed is None or path.suffix.lower() not in PACKED_NAMES:
            raise
        raise bad_file(str(path), f"is packed ({packed})", "unpack it first") from None


def _reader(path: Path, content: bytes):
    """The reader of a format, by content if the format marks itself, else by extension."""
    suffix = path.suffix.lower()
    if content[:4] == b"HAIR":
        return cemyuksel.read
    if tressfx_text.recognised(content):
        return tressfx_text.read
    if suffix == ".tfx":
        return tressfx.read
    if suffix == ".data":
        return counted.read_hairsalon
    if suffix == ".bin":
        return counted.read_ct2hair
    if suffix == ".hair":
        raise bad_file(str(path), "does not begin with HAIR", "give a file in Cem Yuksel's format")
    raise bad_file(
        str(path), "is not a known groom file, by content or by name", f"give {' '.join(EXTENSIONS)}, or USD curves"
    )


def _check_finite(points: np.ndarray, path: Path) -> None:
    bad = ~np.isfinite(points).all(axis=1)
    if bad.any():
        raise bad_file(
            str(path),
            f"{bad.sum()} of {len(bad)} points are not finite, first number {bad.argmax()}",
            "repair it",
        )


def _own_unit(raw: RawGroom, points: np.ndarray, path: Path) -> tuple[float, list[str]]:
    """The unit [m] of a file's points (P, 3) if the caller names none: its format's, or what suits a head; and the note on it."""
    scalp = _scalp(_roots(raw, points))
    size = float((points.max(axis=0).astype(np.float64) - points.min(axis=0)).max())
    likely = _likely_unit(scalp if scalp > 0 else size / 2)  # one strand, or all from one point
    if raw.unit is None:
        return likely, [_unstated(path, "does not state its unit", scalp, likely)]
    if raw.unit == likely or not size > 0:
        return raw.unit, []
    fact = f"its format counts in {_name(raw.unit)}, which makes it {raw.unit * size:.3g} m of hair"  # ten times off, or more
    return raw.unit, [f"{path}: {fact}; import --unit {_name(likely)}?"]


def _roots(raw: RawGroom, points: np.ndarray) -> np.ndarray:
    """First points (S, 3) of the strands, of all points (P, 3) in units of the file."""
    starts = np.cumsum(raw.counts, dtype=np.int64) - raw.counts
    return points[starts[raw.counts > 0]].astype(np.float64)


def _scalp(roots: np.ndarray) -> float:
    """Width of the scalp, by the roots, in units of the file."""
    return float(np.ptp(np.percentile(roots, [2, 98], axis=0), axis=0).max()) if len(roots) else 0.0


def _likely_unit(extent: float, units=(1.0, 0.01, 0.001)) -> float:
    """The unit [m] by which an extent is nearest to a narrow scalp's width, as a ratio."""
    return min(units, key=lambda unit: abs(np.log(max(extent, 1e-12) * unit / SCALP)))


def _unstated(subject, fact: str, scalp: float, unit: float) -> str:
    return f"{subject}: {fact}; {_taken(scalp, unit)}; import --unit says otherwise"


def _taken(scalp: float, unit: float) -> str:
    """Which unit was taken and how wide it makes the scalp; whether that is odd; and how wide inches would make it, if they fit a
    narrow scalp better.
    """
    inch = UNITS["in"]
    if scalp <= 0:
        return f"took 1 {_name(unit)}, which suits hair"
    width = scalp * unit
    odd = ", narrow" if width < NARROW else ", more than a head" if width > WIDE else ""
    told = f"took 1 {_name(unit)}, by which the scalp is {100 * width:.3g} cm wide{odd}"
    inches = unit < inch and _likely_unit(scalp, (unit, inch)) == inch
    return f"{told}; in inches {100 * scalp * inch:.3g} cm" if inches else told


def _name(unit: float) -> str:
    return next(name for name, metres in UNITS.items() if metres == unit)
