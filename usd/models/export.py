# SPDX-License-Identifier: Apache-2.0
"""Unpack a model for other runtimes: plain ONNX files and `description.json`, which says how to feed them."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path, atomic_write
from neuralocks_core.json_values import plain, readable
from neuralocks_core.models import model_file

from ..border.stopping import check
from .description import described

if TYPE_CHECKING:
    from neuralocks_core.models.runtime import StrandModel

    from ..shot.stage import StageGroom

DESCRIPTION = "description.json"


def export_model(model, folder, shot=None, *, grooms=None, skeleton=None, head=None, joints=None) -> list[Path]:
    """Write the graphs and `description.json` of a model file into a folder.

    Args:
        model: path of a `.neuralocks` file; the shipped strand model if None, with a shot the one that suits its grooms.
        folder: made if it does not exist; files of an earlier export are replaced, or removed if this one has no such files.
        shot: a USD file; the data of its grooms that is the same in every frame (`groom_tables`) is written, too.
        grooms, skeleton, head, joints: as for `bake`.

    Returns:
        The files written, `description.json` among them.

    Raises:
        NeuralocksError: the model cannot be read, the folder cannot be written, a foreign file already has the name of an
            output, or what stops a bake of the shot.
    """
    file = model_file.read(model_file.shipped() if model is None else model, None if shot is None else "strands")
    folder = as_path(folder, "folder")
    if shot is None and (grooms or skeleton or head or joints):
        raise NeuralocksError(
            "--groom, --skeleton, --head, --joint: choose within a shot; give it with --shot, or leave them out"
        )
    before = _told(folder / DESCRIPTION)
    ours = set() if before is None else _written(before) | {DESCRIPTION}
    read, mover = [], None
    if shot is not None:
        read, mover = _grooms(shot, model, grooms, skeleton, head, joints)
        file = mover.file
    description = described(file)
    tables = {}
    with ExitStack() as all_or_none:

        def put(name: str) -> Path:
            if name not in ours and (folder / name).is_file():
                raise NeuralocksError(f"{folder / name}: belongs to something else; move it, or choose another folder")
            return all_or_none.enter_context(atomic_write(folder / name))

        if mover is not None:
            from .groom_tables import ARRAYS, export_grooms

            tables = export_grooms(read, mover, put)
            description["grooms"] = {"arrays": ARRAYS, "files": tables}
        files = dict(file.graphs) | {DESCRIPTION: readable(plain(description)).encode()}
        for name, data in files.items():
            put(name).write_bytes(data)
        check()
    # Beside graphs of another model, data of an earlier export would give wrong hair without a word.
    for name in ours - {*files, *tables}:
        if os.path.isfile(folder / name):  # also False for a name that no disk can hold
            (folder / name).unlink()
    return [folder / name for name in (*files, *tables)]


def _grooms(shot, model, *chosen) -> tuple[Sequence[StageGroom], StrandModel]:
    """The grooms of a shot, and the model that moves them all.

    Raises:
        NeuralocksError: the shot cannot be baked, or different shipped models suit its grooms.
    """
    from ..baking.groom_models import GroomModels
    from ..shot.stage import read_shot

    groom_models = GroomModels(model)
    grooms = read_shot(shot, *chosen, still=True).grooms
    (mover, some), *others = groom_models.each(grooms)
    if others:
        raise NeuralocksError(
            f"{some[0].path}, {others[0][1][0].path}: different shipped models suit them; export each with --groom "
            "into a folder of its own, or name a MODEL"
        )
    return grooms, mover


def _told(path: Path) -> dict | None:
    """The description of an earlier export; None if there is none.

    Raises:
        NeuralocksError: the file is something else.
    """
    if not path.exists():
        return None
    try:
        told = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        told = None
    if not (isinstance(told, dict) and {"units", "graphs", "model"} <= told.keys()):
        raise NeuralocksError(f"{path}: belongs to something else; move it, or choose another folder")
    return told


def _written(told: dict) -> set[str]:
    """Names of the files that a description tells of: graphs and tables beside it, and nothing elsewhere, whatever it says."""
    grooms = told.get("grooms")
    parts = told.get("graphs"), grooms.get("files") if isinstance(grooms, dict) else None
    names = {str(name) for part in parts if isinstance(part, dict) for name in part}
    return {name for name in names if Path(name).name == name and Path(name).suffix in (".onnx", ".npz")}
