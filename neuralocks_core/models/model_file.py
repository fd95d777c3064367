# SPDX-License-Identifier: Apache-2.0
"""The one-file model, `*.neuralocks`: a zip of ONNX graphs and one JSON. Only its graphs are ever executed."""

import json
import os
import stat
import zipfile
import zlib
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from neuralocks_core.errors import NeuralocksError, fact_of
from neuralocks_core.files import as_path, atomic_write
from neuralocks_core.models.shortcomings import shortcomings

FORMAT = 1
SUFFIX = ".neuralocks"
KINDS = {
    "strands": ("encoder.onnx", "strand.onnx", "frame.onnx", "tail.onnx"),
    "rig": ("rig.onnx",),
}
REMEDIES = {
    "strands": "train with a smaller --set rate",
    "rig": "give --bend, --weight and --damping nearer to their defaults",
}
"""Kind -> what a user can do about a training that diverged."""
CARD = (("training", dict, "table of values"), ("report", dict, "table of values"), ("credits", list, "list of lines"))
"""Metadata of every model; empty if its file lacks it."""
_DEEPEST = 200
"""Values within values of the card, of which each training that goes on from another adds one: whoever shows it goes down as far."""
_LARGEST = 64 << 20
"""Bytes of one unpacked entry; a model has about one million, so this refuses a zip bomb."""
_LARGEST_FILE = 5 * _LARGEST
"""Bytes of a file: larger ones are not searched for a zip."""
_PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Other compression methods have errors, and memory needs, of their own."""


@dataclass(frozen=True)
class ModelFile:
    """A model as read from disk: `meta` is the JSON with all of `CARD`, `graphs` the ONNX files by name."""

    path: Path
    meta: dict
    graphs: dict[str, bytes] = field(repr=False)

    @property
    def kind(self) -> str:
        """`strands` or `rig`."""
        return self.meta["kind"]

    def shortcomings(self) -> list[str]:
        """What its own report says against using this model, as notes for a user."""
        return shortcomings(self.path, self.kind, self.meta["report"])


@cache
def shipped(kind: str = "strands") -> Path:
    """Path of the model that is used if none is named; searched once, since live hair asks in every frame.

    Raises:
        NeuralocksError: this installation lacks it.
    """
    path = Path(__file__).parents[1] / "shipped" / f"{kind}{SUFFIX}"
    if not path.is_file():
        raise NeuralocksError(
            f"{path.name}: the shipped model is missing from this installation; reinstall or give --model"
        )
    return path


@cache
def specialists() -> tuple[Path, ...]:
    """Paths of the shipped strand models that know some styles better than `shipped()`; see `deformation.model_choice`."""
    return tuple(sorted((Path(__file__).parents[1] / "shipped").glob(f"strands_*{SUFFIX}")))


def kind_known(path: Path) -> str:
    """The kind of hair that one of `specialists()` knows, such as "short"; "" for any other model."""
    return path.stem.partition("_")[2] if path in specialists() else ""


def named(path: str | os.PathLike) -> Path:
    """The path of a model file to write.

    Raises:
        NeuralocksError: it is not a model file's name.
    """
    path = Path(path)
    if path.suffix != SUFFIX:
        raise NeuralocksError(f"{path}: a model file ends in {SUFFIX}; choose such a name")
    return path


def write(path: str | os.PathLike, meta: dict, graphs: dict[str, bytes]) -> Path:
    """Write a model file atomically under its final name.

    Args:
        path: ends in `.neuralocks`.
        meta: plain JSON values; `kind` is needed, `format` is set here.
        graphs: the ONNX files that `KINDS[kind]` lists.

    Raises:
        NeuralocksError: the name is wrong, the file cannot be written, or `meta` holds NaN or infinity.
        ValueError: the graphs are not those of its kind.
    """
    path = named(path)
    if set(graphs) != set(KINDS[meta["kind"]]):
        raise ValueError(f"a {meta['kind']} model holds {KINDS[meta['kind']]}, not {tuple(graphs)}")
    try:
        text = json.dumps({**meta, "format": FORMAT}, indent=1, allow_nan=False)
    except ValueError:
        raise NeuralocksError(
            f"{path}: its description would hold NaN or infinity, as after a training that diverged; {REMEDIES[meta['kind']]}"
        ) from None
    with atomic_write(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in {"model.json": text.encode(), **graphs}.items():
            # A fixed date: the same training gives the same bytes.
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)
    return path


def read(path: str | os.PathLike, kind: str | None = None) -> ModelFile:
    """Read a model file.

    Args:
        path: the file.
        kind: what it must be, `strands` or `rig`.

    Raises:
        NeuralocksError: the file is missing, damaged, of a later format or of another kind.
    """
    path = as_path(path, "model")
    try:
        _check_file(path)
        with zipfile.ZipFile(path) as archive:
            entries = {info.filename: info for info in archive.infolist()}
            if "model.json" not in entries:
                raise NeuralocksError(
                    f"{path}: it is not a neuralocks model (no model.json inside); choose a .neuralocks file"
                )
            meta = _parsed(_entry(archive, entries["model.json"], path))
            _check(meta, path, kind)
            missing = [name for name in KINDS[meta["kind"]] if name not in entries]
            if missing:
                raise NeuralocksError(f"{path}: it lacks {missing[0]}; get an undamaged copy of the model")
            graphs = {name: _entry(archive, entries[name], path) for name in KINDS[meta["kind"]]}
    except NeuralocksError:
        raise
    except FileNotFoundError:
        raise NeuralocksError(
            f"{path}: no such model file; check the path, or leave it out for the shipped one"
        ) from None
    except (
        OSError,
        ValueError,
        zipfile.BadZipFile,
        EOFError,
        NotImplementedError,
        RuntimeError,
        RecursionError,
    ) as error:
        if path.suffix.lower() != SUFFIX:
            raise NeuralocksError(
                f"{path}: it is not a neuralocks model ({fact_of(error)}); choose a {SUFFIX} file"
            ) from None
        raise NeuralocksError(f"{path}: damaged or not a model ({fact_of(error)}); get an undamaged copy") from None
    return ModelFile(path, meta, graphs)


def _check_file(path: Path) -> None:
    found = os.stat(path)
    if stat.S_ISDIR(found.st_mode):
        raise NeuralocksError(f"{path}: is a folder; name the .neuralocks file in it")
    if not stat.S_ISREG(found.st_mode):  # a device has no end, and a pipe may never begin
        raise NeuralocksError(f"{path}: is not a file; choose a .neuralocks file")
    if found.st_size > _LARGEST_FILE:
        raise NeuralocksError(f"{path}: has {found.st_size} bytes, more than a model has; choose a .neuralocks file")


def _parsed(text: bytes):
    try:
        return json.loads(text)
    except ValueError as error:  # not UTF-8, not JSON, or a number with thousands of digits
        raise zipfile.BadZipFile(fact_of(error)) from None


def _entry(archive: zipfile.ZipFile, info: zipfile.ZipInfo, path: Path) -> bytes:
    if info.file_size > _LARGEST:
        raise NeuralocksError(
            f"{path}: {info.filename} claims {info.file_size} bytes, more than a model has; get another copy"
        )
    if info.compress_type not in _PACKED:
        raise NeuralocksError(f"{path}: {info.filename} is not packed as in a model; get an undamaged copy")
    try:
        # Reads the claimed size plus one byte, to see the end: zipfile's own `read` unpacks everything and cuts off the excess.
        with archive.open(info) as file:
            return file.read(info.file_size + 1)
    except zlib.error as error:
        raise NeuralocksError(f"{path}: {info.filename} is damaged ({fact_of(error)}); get an undamaged copy") from None


def _check(meta, path: Path, kind: str | None) -> None:
    if not isinstance(meta, dict) or not isinstance(meta.get("format"), int):
        raise NeuralocksError(f"{path}: model.json has no format number; get an undamaged copy of the model")
    if meta["format"] > FORMAT:
        raise NeuralocksError(
            f"{path}: it has format {str(meta['format'])[:40]}, this version reads up to {FORMAT}; update neuralocks"
        )
    if not isinstance(meta.get("kind"), str) or meta["kind"] not in KINDS:
        raise NeuralocksError(f"{path}: it holds a '{str(meta.get('kind'))[:40]}', unknown here; update neuralocks")
    for name, kind_of, said in CARD:
        if meta.get(name) is None:
            meta[name] = kind_of()
        if not isinstance(meta[name], kind_of) or _nested(meta[name], _DEEPEST):
            raise NeuralocksError(f"{path}: its '{name}' is not a {said}; get an undamaged copy of the model")
    if kind and meta["kind"] != kind:
        names = {"strands": "strand hair", "rig": "rigged mesh hair"}
        raise NeuralocksError(
            f"{path}: it is a model for {names[meta['kind']]}, not for {names[kind]}; give one that is"
        )


def _nested(value, deepest: int) -> bool:
    """Whether there are values within values beyond so many levels."""
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return deepest < 0 or any(_nested(part, deepest - 1) for part in parts)
