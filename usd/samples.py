# SPDX-License-Identifier: Apache-2.0
"""Writing all samples of a bake: computed in ascending order, kept frame by frame, assembled meanwhile.

Each sample is a pure function of the shot and its time code. So order, chunks, jobs and interruptions leave no trace in
the file.
"""

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol

import numpy as np

from neuralocks_core.errors import NeuralocksError

from .behind import Behind
from .override import OverrideWriter, reload_open, to_text, used_files
from .spool import Spool, fingerprint
from .stage import Shot, StageGroom

HALF = 0.5
"""Time codes to each side over which a velocity is measured."""


class Poser(Protocol):
    """What gives a groom's points."""

    def points(self, time_code: float) -> np.ndarray:
        """(P, 3) float32, in the prim's own space and units."""

    def close(self) -> None:
        """Called when no more points are wanted."""


def write_samples(
    shot: Shot,
    out: Path,
    codes: list[float],
    poser: Callable[[StageGroom], Poser],
    inputs: dict,
    *,
    velocities: bool = True,
    progress: Callable[[int, int, str], None] | None = None,
) -> int:
    """Write an override layer.

    Args:
        shot: what is overridden.
        out: `.usdc`, `.usd` or `.usda`.
        codes: ascending time codes.
        poser: makes the poser of a groom; called only if something is left to compute.
        inputs: plain values that, with the shot's files, determine every sample.
        velocities: write velocities.
        progress: called with (done, total, message).

    Returns:
        Frames taken over from an interrupted bake of the same inputs.

    Raises:
        NeuralocksError: the file cannot be written. Nothing is left then, neither under its name nor beside it; only a
            stop by the user leaves the finished frames, to go on from.
    """
    _check_not_input(out, shot)
    _check_space(out, shot, len(codes), velocities)
    facts = {**inputs, "velocities": velocities, "grooms": [item.path for item in shot.grooms]}
    spool = Spool(out, fingerprint(used_files(shot.stage), facts))
    try:
        return _write(shot, codes, poser, spool, velocities, progress or (lambda done, total, message: None))
    except KeyboardInterrupt:
        spool.close()
        raise
    except BaseException:
        spool.discard()
        raise


def check_out(out: Path) -> None:
    """Refuse a name that is no USD layer.

    Raises:
        NeuralocksError: it is not.
    """
    if out.suffix.lower() not in (".usdc", ".usd", ".usda"):
        raise NeuralocksError(f"{out}: a bake is a USD layer; end its name with .usdc, .usd or .usda")
    if out.is_dir():
        raise NeuralocksError(f"{out}: is a folder; give a file name")


def _write(shot: Shot, codes, poser, spool: Spool, velocities: bool, say) -> int:
    writer = OverrideWriter(spool.layer_path, spool.out, shot, codes)
    total, done, resumed = len(codes) * len(shot.grooms), 0, 0
    say(0, total, "reading")
    with Behind() as behind:
        for number, item in enumerate(shot.grooms):
            behind.put(writer.groom, item, velocities)
            frames = _Frames(shot, item, poser, velocities)
            try:
                for code in codes:
                    resumed += _frame(spool, behind, writer, item, number, code, frames)
                    done += 1
                    say(done, total, item.path)
            finally:
                frames.close()
        behind.put(writer.close)
    if spool.out.suffix.lower() == ".usda":
        text = spool.layer_path.with_suffix(".usda")
        to_text(spool.layer_path, text, spool.out)
        os.replace(text, spool.layer_path)
    spool.finish()
    reload_open(spool.out)
    return resumed


def _frame(
    spool: Spool, behind: Behind, writer: OverrideWriter, item: StageGroom, number: int, code: float, frames
) -> bool:
    """One frame, one array after the other; whether it was there already."""
    count = len(item.groom.points)
    there = all(spool.holds(number, code, name, count) for name in frames.names)
    arrays = (spool.read(number, code, name) for name in frames.names) if there else frames.at(code)
    for name, array in zip(frames.names, arrays):
        if not there:
            behind.put(spool.write, number, code, name, array)
        held = [array]  # the writer takes it out as soon as it has its own copy
        del array
        behind.put(writer.sample, item, code, name, held)
    return there


class _Frames:
    """Samples of one groom in ascending order; the pose half-way between two frames is computed once."""

    def __init__(self, shot: Shot, item: StageGroom, poser: Callable[[StageGroom], Poser], velocities: bool):
        self._item, self._make, self._poser = item, poser, None
        self.names = ("points", "velocities") if velocities else ("points",)
        self._rate = shot.border.rate
        self._kept: tuple[float, np.ndarray] | None = None

    def at(self, code: float) -> Iterator[np.ndarray]:
        """Points, then velocities per second, (P, 3) float32; each can be let go before the next is made."""
        if self._poser is None:
            self._poser = self._make(self._item)
        before, after = around(self._item, code)
        wanted = len(self.names) == 2
        if wanted and after > before and (self._kept is None or self._kept[0] != before):
            self._kept = before, self._poser.points(before)
        yield self._poser.points(code)
        if not wanted:
            return
        if after <= before:
            yield np.zeros_like(self._item.groom.points)
            return
        velocity, later = self._kept[1], self._poser.points(after)
        self._kept = after, later
        np.subtract(later, velocity, out=velocity)
        velocity *= np.float32(self._rate / (after - before))
        yield velocity

    def close(self) -> None:
        """Let threads and buffers go."""
        self._kept = None
        if self._poser is not None:
            self._poser.close()


def around(item: StageGroom, code: float) -> tuple[float, float]:
    """The two time codes whose difference is the velocity at `code`.

    Outside of its samples the animation stands still: differences are taken inside only, on one side at the ends.
    """
    clip, moving = item.attachment.rig.time_codes, item.placement.samples
    first = min([clip[0], *moving[:1]])
    last = max([clip[-1], *moving[-1:]])
    return min(max(code - HALF, first), last), min(max(code + HALF, first), last)


def _check_not_input(out: Path, shot: Shot) -> None:
    if os.path.realpath(out) in {os.path.realpath(path) for path in used_files(shot.stage)}:
        raise NeuralocksError(f"{out}: is part of the shot itself; choose another name for the bake")


def _check_space(out: Path, shot: Shot, count: int, velocities: bool) -> None:
    size = sum(len(item.groom.points) for item in shot.grooms) * 12 * (1 + velocities) * count
    folder = next((p for p in [out.parent, *out.parent.parents] if p.is_dir()), None)
    if folder is not None and 2.05 * size > (free := shutil.disk_usage(folder).free):
        raise NeuralocksError(
            f"{out}: needs {2.05 * size / 1e9:.2f} GB while it is written, {free / 1e9:.2f} GB are free; "
            "free some, bake fewer frames or choose another folder"
        )
