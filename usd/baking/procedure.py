# SPDX-License-Identifier: Apache-2.0
"""The start and end of every bake, whatever moves its hair."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.progress import Progress, silent
from neuralocks_core.wind import Wind

from ..border.time_codes import given_cuts, time_codes
from ..border.told_once import few
from ..shot.bakes.also_changed import also_changed
from ..shot.bakes.gaps import hidden
from ..shot.notes.range_notes import asked_notes
from ..shot.notes.stage_notes import out_of_place
from ..shot.stage import Shot, check_frames_named, read_shot
from ..shot.strands.curves import find_curves


@dataclass(frozen=True)
class BakeResult:
    """What a bake did.

    Attributes:
        path: the override layer.
        frames: time codes in the layer.
        grooms: per groom: path, strands, points, joint, how the joint was found, and the name of the model if there is one.
        notes: what a user should know.
        seconds: wall time.
        resumed: frames taken over from an interrupted bake, counted for each groom.
        residual: median, worst and number of steps of what the implicit solver left in each, see
            `neuralocks_core.reference.solver.SimulatedHair`; None if it solved nothing.
    """

    path: Path
    frames: list[float]
    grooms: list[dict]
    notes: list[str]
    seconds: float
    resumed: int
    residual: dict | None = None


def read_asked(
    shot, how: dict, cuts, loop: bool, frames, subframes: int, wind: Wind | None, progress: Progress | None
) -> tuple[Shot, list[float]]:
    """The shot, read if it is not yet, and the time codes asked for; arguments as for `bake`.

    Raises:
        NeuralocksError: the shot cannot be read, or was read already and `how` or the cuts say how; there are no such frames.
    """
    (progress or silent)(0, 1, "reading the shot")  # for a crowd, this takes longer than a user waits without a message
    if isinstance(shot, Shot):
        if late := [name for name, value in {**how, "cuts": cuts}.items() if value is not None]:
            raise NeuralocksError(f"{shot.path}: is read already, so '{late[0]}' comes too late; give it to read_shot")
        if loop and any(len(rig.clip.cuts) for rig in shot.rigs):
            raise NeuralocksError(f"{shot.path}: was read with cuts, and a loop has none; give cuts=[] to read_shot")
        if loop:
            shot = replace(shot, cuts=[])
    else:
        shot = read_shot(shot, **how, cuts=given_cuts(cuts, loop), still=wind is not None)
    check_frames_named(shot.path, frames, shot.first, shot.last, shot.rigs)
    samples = [code for rig in shot.rigs for code in rig.joints.keys.every]
    return shot, time_codes(frames, shot.first, shot.last, subframes, shot.border.frame, samples)


def known_notes(shot: Shot, codes: list[float], loop: bool, dynamic: bool = True) -> list[str]:
    """Notes for the user before hair is posed at time codes; if it is `dynamic`, also on where it starts anew, unless the user said so."""
    found = [rig for rig in shot.rigs if dynamic and (loop or shot.given_cuts(rig) is None)]
    return [
        *shot.notes,
        *asked_notes(shot.stage, shot.rigs, codes, loop),
        *(text for rig in shot.rigs if loop for text in rig.loop_notes(codes)),
        *(text for rig in found for text in rig.cut_notes(loop)),
        *few(
            [text for item in shot.grooms for text in hidden(item.prim, codes, shot.border.frame)],
            "grooms are baked already",
        ),
        *also_changed((item.prim for item in shot.grooms), find_curves(shot.stage)),
    ]


def write_told(
    notes: list[str],
    tell: Callable[[list[str]], None] | None,
    began: float,
    shot: Shot,
    out: Path,
    codes: list[float],
    write: Callable[[], int],
) -> BakeResult:
    """Tell the notes, write the samples, then tell what is wrong with the output's folder.

    Args:
        notes: those known before.
        tell: as for `bake`.
        began: on the clock of `time.monotonic`.
        shot, out, codes: as for `write_samples`.
        write: writes the samples and returns how many frames were taken over.
    """
    say = tell or _unheard
    say(notes)
    resumed = write()
    late = out_of_place(shot.stage, out)
    say(late)
    return BakeResult(out, codes, _described(shot), notes + late, time.monotonic() - began, resumed)


def _unheard(notes: list[str]) -> None:
    pass


def _described(shot: Shot) -> list[dict]:
    return [
        {
            "path": item.path,
            "strands": item.groom.strand_count,
            "points": item.point_count,
            "joint": item.joint,
            "how": item.attachment.how,
        }
        for item in shot.grooms
    ]
