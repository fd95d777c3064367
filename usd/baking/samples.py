# SPDX-License-Identifier: Apache-2.0
"""Writing all samples of a bake: computed in ascending order, kept frame by frame, assembled meanwhile.

Each sample is a pure function of the shot and its time code. So order, chunks, jobs and interruptions leave no trace in
the file.
"""

import math
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.progress import Progress, silent

from ..border.damage import names_damage
from ..border.stage_files import check_not_input, unsaved, used_files
from ..border.stopping import stopped
from ..shot.stage import Shot, StageGroom
from .batches import batches
from .override import OverrideWriter, deliver
from .sample_layer import Lagging
from .spool import Spool, fingerprint, program_files, unsaved_digest
from .stencils import Stencils
from .write_behind import WriteBehind

BLOCK = 1 << 16
"""Points that are read back and written at a time."""


class Poser(Protocol):
    """What gives the points of grooms."""

    def points(self, time_code: float) -> np.ndarray:
        """(P, 3) float32 of all grooms, one after the other, each in its prim's own space and units."""


@names_damage
def write_samples(
    shot: Shot,
    out: Path,
    codes: list[float],
    poser: Callable[[list[StageGroom]], Poser],
    inputs: dict,
    facts: dict,
    *,
    together: bool = False,
    velocities: bool = True,
    progress: Progress | None = None,
) -> int:
    """Write an override layer.

    Args:
        shot: what is overridden.
        out: `.usdc`, `.usd` or `.usda`.
        codes: ascending time codes.
        poser: makes the poser of grooms; called only if something is left to compute.
        inputs: plain values that, with the shot, its files and this program's, determine every sample.
        facts: what the file tells of how it was made, see `recorded`.
        together: pose the grooms of a head together, not each alone.
        velocities: write velocities.
        progress: called with (done, total, message).

    Returns:
        Frames taken over from an interrupted bake of the same inputs, counted for each groom.

    Raises:
        NeuralocksError: the file cannot be written. Nothing is left then, neither under its name nor beside it; only a
            stop by the user, or too little space to go on, leaves the finished frames, to go on from.
    """
    check_not_input(out, shot.stage)
    inputs = {**inputs, "velocities": velocities, "grooms": [_carried(item) for item in shot.grooms]}
    inputs["unsaved"] = unsaved_digest(unsaved(shot.stage))
    batched = batches(shot.grooms) if together else [[item] for item in shot.grooms]
    spool = Spool(out, fingerprint([*used_files(shot.stage), *program_files()], inputs))
    _check_space(spool, batched, codes, velocities)
    try:
        return _write(shot, codes, batched, poser, spool, facts, velocities, progress or silent)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt) or stopped():
            spool.close()
        else:
            spool.discard()
        raise


def _carried(item: StageGroom) -> list:
    """How a groom was read, as far as its samples depend on it: which joints of which skeleton, from where, which cuts."""
    found, character = item.attachment, item.attachment.character
    joints = {name: int(joint) for name, joint in character.humanoid.items()} | {"": int(character.carrying_joint)}
    return [item.path, found.rig.path, joints, found.to_bind.tolist(), found.rig.clip.cuts.tolist()]


def _write(shot: Shot, codes, batched: list, poser, spool: Spool, facts: dict, velocities: bool, say) -> int:
    writer = OverrideWriter(spool.layer_path, spool.out, shot, codes)
    plans = [[Stencils(item, codes, shot.first, velocities) for item in items] for items in batched]
    needed = [sorted(set().union(*(plan.codes for plan in some))) for some in plans]
    # A frame of a batch is posed once, and written for each of its grooms.
    total = sum((2 * len(items) - 1) * len(codes) for items, codes in zip(batched, needed, strict=True))
    done, resumed = 0, 0
    say(0, total, "reading")
    with WriteBehind() as behind:
        for number, (items, some) in enumerate(zip(batched, plans, strict=True)):
            ends = np.cumsum([0, *(item.point_count for item in items)])
            stores = [
                _Store(spool, writer, item, plan, number, int(first)) for item, plan, first in zip(items, some, ends)
            ]
            behind.put(stores[0].open, velocities, facts)
            made = None
            for code in needed[number]:
                if spool.holds(number, code, ends[-1]):
                    resumed += sum(code in plan.wanted for plan in some)
                else:
                    if made is None:
                        made = poser(items)
                        say(done, total, items[0].path)  # the time left is reckoned from here on
                    # At once: points that waited for it would lie in memory beside those of the next frame.
                    spool.write(number, code, made.points(code))
                behind.put(stores[0].frame, code)
                done += len(items)
                say(done, total, items[0].path)
            behind.put(stores[0].finish)
            for store in stores[1:]:
                behind.put(store.whole, velocities, facts)
                done += len(needed[number])
                say(done, total, store.item.path)
        behind.put(writer.close)
    deliver(spool)
    return resumed


class _Store:
    """Writes one groom's points frame by frame, and velocities once both sides are there.

    Args:
        spool, writer: from where, to where.
        item: the groom.
        plan: which time codes.
        number: its batch.
        first: its first point among those of the batch.
    """

    def __init__(self, spool: Spool, writer: OverrideWriter, item: StageGroom, plan: Stencils, number: int, first: int):
        self._spool, self._writer, self.item, self._plan = spool, writer, item, plan
        self._number, self._first = number, first
        self._order = Lagging(item.attachment.rig.border.frame)

    def open(self, velocities: bool, facts: dict) -> None:
        """Before the first frame."""
        self._writer.groom(self.item, velocities, facts)

    def whole(self, velocities: bool, facts: dict) -> None:
        """All of it, where all points are in the spool."""
        self.open(velocities, facts)
        for code in self._plan.codes:
            self.frame(code)
        self.finish()

    def frame(self, code: float) -> None:
        """The next time code in the list, whose points are in the spool."""
        if code in self._plan.wanted:
            self._writer.sample(self.item, code, "points", self._points(code))
            self._differences(self._order.after(code))

    def finish(self) -> None:
        """Write what waits for frames that are not among those wanted."""
        self._differences(self._order.rest())

    def _differences(self, codes: list[float]) -> None:
        for code in codes if self._plan.velocities else ():
            self._writer.sample(self.item, code, "velocities", self._velocities(code))

    def _rows(self) -> Iterator[slice]:
        first, end = self._first, self._first + self.item.point_count
        return (slice(low, min(low + BLOCK, end)) for low in range(first, end, BLOCK))

    def _points(self, code: float) -> Iterator[np.ndarray]:
        """Blocks (n, 3) float32, in units of the prim."""
        return (self._spool.read(self._number, code, rows) for rows in self._rows())

    def _velocities(self, code: float) -> Iterator[np.ndarray]:
        """Blocks (n, 3) float32, in units of the prim per second."""
        terms = self._plan.terms(code)
        for rows in self._rows():
            result = np.zeros((rows.stop - rows.start, 3), np.float32)
            base = None
            for other, weight in terms:
                part = self._spool.read(self._number, other, rows)
                if base is None:
                    base = part
                    continue
                # The weights add up to nothing: of differences, hair that stands still has no velocity by rounding.
                part -= base
                part *= np.float32(weight)
                result += part
            yield result


def _check_space(spool: Spool, batched: list, codes: list[float], velocities: bool) -> None:
    """Refuse a bake for which the disk has no room, beside the frames that are there already, to go on from."""
    size, left = 0.0, 0
    for number, items in enumerate(batched):
        points = sum(item.point_count for item in items)
        frame = 12 * points
        left += frame * sum(spool.seems_to_hold(number, code, points) for code in codes)
        # Every frame's points twice, in the spool and in the layer, and its velocities in the layer.
        size += 1.03 * frame * (2 + velocities) * len(codes)
    if size - left > (free := shutil.disk_usage(spool.folder).free):
        spool.close()
        raise NeuralocksError(
            f"{spool.out}: needs {math.ceil((size - left) / 1e6)} MB while it is written, {free // 1_000_000} MB are free; "
            "free some, bake fewer frames or choose another folder"
        )
