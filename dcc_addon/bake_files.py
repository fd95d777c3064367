# SPDX-License-Identifier: GPL-3.0-or-later
"""Which files a bake writes: where its output may be, and names with which nothing is replaced that belongs to something else."""

import errno
import os
from pathlib import Path

from neuralocks_core.errors import NeuralocksError

from .scene.baked import attach
from .scene.files.paths import absolute, beside, usual_output
from .scene.objects.lookup import find
from .services.work.overwriting import check_ours, untaken


def output_path(path: str) -> str:
    """Absolute path of a bake; if none is chosen, `usual_output`.

    Raises:
        NeuralocksError: it is relative to a file that is not saved, it is a folder, its folder cannot be written, or its name is too
            long.
    """
    chosen = absolute(path if path.strip() else usual_output())
    full = os.path.abspath(chosen)
    if chosen.endswith(("/", os.sep)) or os.path.isdir(full):
        raise NeuralocksError(f"{path}: this is a folder; name a file in it")
    if not full.lower().endswith((".usd", ".usda", ".usdc")):
        full += ".usdc"
    folder = next((p for p in Path(full).parents if os.path.isdir(p)), None)  # missing folders are made
    if folder is None or not os.access(folder, os.W_OK):
        raise NeuralocksError(f"{full}: the folder cannot be written; choose another one")
    try:
        os.lstat(shot_beside(Path(full)))
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise NeuralocksError(f"{full}: its name is too long for this disk; choose a shorter one") from None
    return full


def files_of(looks, path: Path, character: str, label: str) -> tuple[list[tuple], list[str]]:
    """The (file to write, look, names) of each look (`bake_groups`) of a character's hair, and the notes: if `path` belongs to something
    else, files have the `label` in their names.

    Raises:
        NeuralocksError: hair that is not in the bake plays a file, or we did not make it.
    """
    from usd.assets.own_layers import is_own

    free = untaken(path, label, lambda path: any(owner_of(out, character) for out in _outs(path, len(looks))))
    notes = []
    if free != path:
        owner = next(filter(None, (owner_of(out, character) for out in _outs(path, len(looks)))))
        notes.append(f"{path}: it belongs to {owner}, and is kept; this bake is written to {free.name}")
    outs = _outs(free, len(looks))
    groups = [(out, *group) for out, group in zip(outs, looks)]
    for out, _, names in groups:
        if others := [thing.name_full for thing in attach.players(str(out)) if thing.name_full not in names]:
            raise NeuralocksError(f"{out}: {others[0]} plays this file, and is not in this bake; choose another file")
    check_ours([*outs, *map(shot_beside, outs)], is_own)
    return groups, notes


def shot_beside(out: Path) -> Path:
    """The shot that a bake goes over: the character at rest and in motion."""
    return out.with_name(f"{out.stem}_shot.usdc")


def owner_of(out: Path, character: str) -> str:
    """Whom an existing bake `out`, or its shot, belongs to, if not to the character of this full name in this Blender file: what was
    imported from it, another character, or another Blender file that plays it. Otherwise empty.
    """
    from usd.assets.own_layers import character_of, player_of

    shot = shot_beside(out)
    if any(attach.is_imported(str(path)) for path in (out, shot)):
        return "what was imported from it"
    if not shot.is_file():
        return ""
    other, player = character_of(shot), player_of(shot)
    armature = find(character)
    own = any(thing.neuralocks_hair.armature == armature for thing in attach.players(str(out)))  # renamed since
    there = os.path.isfile(os.path.normpath(shot.parent / player))  # as it was written, whatever folder is a link
    if player and player != beside(shot) and (there or not own):  # it may have been moved
        return f"{player}, which plays it"
    return "" if own or other in ("", character) else f"another character, {other}"


def _outs(path: Path, count: int) -> list[Path]:
    """The files of a bake with this many looks."""
    return [path if count == 1 else path.with_name(f"{path.stem}_{n + 1}{path.suffix}") for n in range(count)]
