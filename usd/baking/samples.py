# SPDX-License-Identifier: Apache-2.0
"""Writing all samples of a bake: computed in ascending order, stored frame by frame, and assembled at the same time.

Each sample is a pure function of the shot and its time code. So order, chunks, jobs and interruptions do not change the
file.
"""

import hashlib
import math
import shutil
import traceback
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Hashable, Iterator
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np
from pxr import Sdf

from neuralocks_core.errors import CannotWrite
from neuralocks_core.progress import Progress, silent

from ..border.damage import named, names_damage
from ..border.stage_files import check_not_over, unsaved, used_files
from ..border.stopping import stopped
from ..shot.stage import Shot, StageGroom
from .batches import batches
from .frame_uses import Uses
from .layer.header import write_header
from .layer.override import OverrideWriter, deliver
from .layer.sample_layer import SAVE_EVERY, SampleLayer
from .layer.spool import Spool, fingerprint, program_files, unsaved_digest
from .layer.write_behind import WriteBehind
from .stencils import Stencils

BLOCK = 1 << 16
"""Points that are read back and written at a time."""
TEXT = 3.2
"""How many times as large as in binary samples are in text, in metres; in centimetres, it is less."""


class Poser(Protocol):
    """Computes the points of grooms."""

    def points(self, time_code: float) -> np.ndarray:
        """(P, 3) float32 of all grooms, one after the other, each in its prim's own space and units."""


@names_damage
def write_samples(
    shot: Shot,
    out: Path,
    codes: list[float],
    poser: Callable[[list[StageGroom]], Poser],
    inputs: dict,
    facts: Callable[[StageGroom], dict],
    *,
    moved_by: Callable[[StageGroom], Hashable] | None = None,
    velocities: bool = True,
    blown: bool = False,
    progress: Progress | None = None,
) -> int:
    """Write an override layer.

    Args:
        shot: what is overridden.
        out: `.usdc`, `.usd` or `.usda`.
        codes: ascending time codes.
        poser: makes the poser of grooms; called only if something is left to compute.
        inputs: plain values that, together with the shot, its files and this program's files, determine every sample.
        facts: what the file records about how a groom's hair was made, see `recorded`.
        moved_by: pose the grooms of a head together for which this is the same, not each alone.
        velocities: write velocities.
        blown: whether there is a wind.
        progress: called with (done, total, message).

    Returns:
        Frames taken over from an interrupted bake of the same inputs, counted for each groom.

    Raises:
        NeuralocksError: it cannot be made. Then nothing is left under its name or beside it. Only a stop by the user or an error of
            the file system, such as a full disk (CannotWrite), leaves the finished frames, to resume from.
    """
    check_not_over(out, shot.stage)
    inputs = {**inputs, "velocities": velocities, "grooms": [_carried(item) for item in shot.grooms]}
    inputs["unsaved"] = unsaved_digest(unsaved(shot.stage))
    batched = batches(shot.grooms, moved_by) if moved_by else [[item] for item in shot.grooms]
    spool = Spool(out, fingerprint([*used_files(shot.stage), *program_files()], inputs))
    try:
        return _write(shot, codes, batched, poser, spool, facts, velocities, blown, progress or silent)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt | CannotWrite) or stopped():
            spool.close()
        else:
            # These stack frames hold the layer, and Windows does not remove a file that is mapped.
            traceback.clear_frames(error.__traceback__)
            spool.discard()
        raise


def _carried(item: StageGroom) -> list:
    """How a groom was read, as far as its samples depend on it: which joints of which skeleton, from where, which cuts."""
    found, character = item.attachment, item.attachment.character
    joints = {name: int(joint) for name, joint in character.humanoid.items()} | {"": int(character.carrying_joint)}
    return [item.path, found.rig.path, joints, found.to_bind.tolist(), found.rig.clip.cuts.tolist()]


def _write(shot: Shot, codes, batched: list, poser, spool: Spool, facts, velocities, blown: bool, say) -> int:
    plans = [[Stencils(item, codes, shot.first, velocities, blown) for item in items] for items in batched]
    uses = Uses(plans)
    there = spool.go_on(_plan(shot, spool.out, codes, facts), uses.spent)
    needed = [uses.codes(number) for number in range(len(plans))]
    spool.keep_only((number, c) for number, some in enumerate(needed) for c in some if not uses.over(number, c, there))
    _check_space(spool, batched, codes, velocities)
    file = SampleLayer(spool.layer_path, spool.out, spool.log, there)
    writer = OverrideWriter(file, spool.out, shot, codes)
    # A frame of a batch is posed once, and written for each of its grooms.
    total = sum((2 * len(items) - 1) * len(some) for items, some in zip(batched, needed, strict=True))
    done, resumed, begin = 0, 0, 0

    def forget() -> None:
        for frame in uses.used_up(file.saved):
            spool.forget(*frame)

    say(0, total, "reading")
    with WriteBehind() as behind:
        for number, (items, some) in enumerate(zip(batched, plans, strict=True)):
            stores, first = [], 0
            for item, plan in zip(items, some, strict=True):
                stores.append(_Store(spool, writer, item, plan, number, first, max(0, there - begin)))
                begin, first = begin + len(plan.puts), first + item.point_count
            behind.put(stores[0].open, velocities, facts(items[0]))
            made = None
            for code in needed[number]:
                if uses.over(number, code, there) or spool.holds(number, code, first):
                    resumed += sum(code in plan.wanted for plan in some)
                else:
                    if made is None:
                        made = poser(items)
                        say(done, total, items[0].path)  # the time left is estimated from here on
                    # Write them now: waiting points would be in memory together with those of the next frame.
                    spool.write(number, code, made.points(code))
                behind.put(stores[0].put, code, forget)
                done += len(items)
                say(done, total, items[0].path)
            for store in stores[1:]:
                behind.put(store.whole, velocities, facts(store.item), forget)
                done += len(needed[number])
                say(done, total, store.item.path)
        behind.put(writer.close)
    deliver(spool)
    return resumed


def _plan(shot: Shot, out: Path, codes: list[float], facts: Callable[[StageGroom], dict]) -> str:
    """Digest of a layer's content besides its samples, and of their time codes. A moved folder changes it, because the path to the
    shot changes, and so do recorded options that change no sample.
    """
    header = Sdf.Layer.CreateAnonymous()
    with named(out):
        write_header(header, shot.stage, shot.border, shot.path, out, codes)
    return hashlib.sha256(
        repr((codes, [facts(item) for item in shot.grooms], header.ExportToString())).encode()
    ).hexdigest()


class _Store:
    """Writes one groom's samples as the frames that they need become available.

    Args:
        spool, writer: where to read and where to write.
        item: the groom.
        plan: which samples.
        number: its batch.
        first: index of its first point in the batch.
        there: how many samples need not be written.
    """

    def __init__(
        self,
        spool: Spool,
        writer: OverrideWriter,
        item: StageGroom,
        plan: Stencils,
        number: int,
        first: int,
        there: int,
    ):
        self._spool, self._writer, self.item, self._plan = spool, writer, item, plan
        self._number, self._first = number, first
        self._left = deque(plan.puts[there:])

    def open(self, velocities: bool, facts: dict) -> None:
        """Begin the groom, before the first frame."""
        self._writer.groom(self.item, velocities, facts)

    def put(self, code: float, done: Callable[[], None]) -> None:
        """Write the samples that need no frame after `code`, from frames in the spool; `done` is called after each."""
        while self._left and max(self._left[0][2], default=code) <= code:
            name, at, _ = self._left.popleft()
            self._writer.sample(
                self.item, at, name, partial(self._points if name == "points" else self._velocities, at)
            )
            done()

    def whole(self, velocities: bool, facts: dict, done: Callable[[], None]) -> None:
        """Write the whole groom, once all frames are in the spool."""
        self.open(velocities, facts)
        self.put(math.inf, done)

    def _blocks(self, into: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
        """Parts (n, 3) of an array for all points of the groom, each with the index of its first point in the batch."""
        for low in range(0, len(into), BLOCK):
            yield self._first + low, into[low : low + BLOCK]

    def _points(self, code: float, into: np.ndarray) -> Iterator[np.ndarray]:
        """Fills an array (P, 3) float32 in units of the prim; yields parts of it as they are filled."""
        for first, part in self._blocks(into):
            self._spool.read(self._number, code, first, part)
            yield part

    def _velocities(self, code: float, into: np.ndarray) -> Iterator[np.ndarray]:
        """The same for velocities, in units of the prim per second."""
        (base_code, _), *terms = self._plan.terms(code) or [(code, 0.0)]
        base, other = np.empty((2, min(BLOCK, len(into)), 3), np.float32)
        for first, part in self._blocks(into):
            here, term = base[: len(part)], other[: len(part)]
            part.fill(0)
            if terms:
                self._spool.read(self._number, base_code, first, here)
            for term_code, weight in terms:
                self._spool.read(self._number, term_code, first, term)
                # The weights sum to zero. With differences, hair that stands still gets no velocity from rounding.
                term -= here
                term *= np.float32(weight)
                part += term
            yield part


def _check_space(spool: Spool, batched: list, codes: list[float], velocities: bool) -> None:
    """Refuse a bake that does not fit on the disk, given the finished frames that are already there to resume from."""
    size, left = 0.0, spool.size()
    for items in batched:
        frame = 12 * sum(item.point_count for item in items)
        # Frames stay until a save, and those that velocities need up to two frames longer; or until another groom's turn.
        near = 5 * items[0].attachment.rig.border.frame
        waiting = SAVE_EVERY / frame + max(bisect_right(codes, code + near) - place for place, code in enumerate(codes))
        kept = min(waiting, len(codes)) if len(items) == 1 else len(codes)
        text = TEXT if spool.out.suffix.lower() == ".usda" else 0  # it is made of the finished layer, and beside that
        size += 1.03 * frame * ((1 + velocities) * (1 + text) * len(codes) + kept)
    if size - left > (free := shutil.disk_usage(spool.folder).free):
        raise CannotWrite(
            f"{spool.out}: needs {math.ceil((size - left) / 1e6)} MB while it is written, {free // 1_000_000} MB are free; "
            "free some, bake fewer frames or choose another folder"
        )
