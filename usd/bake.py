# SPDX-License-Identifier: Apache-2.0
"""Bake: a shot with a groom in, an override layer with moving hair out.

Each sample is a pure function of the shot, the model and its time code. So order, chunks, jobs and interruptions leave
no trace in the file.
"""

import os
import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from neuralocks_core import model as model_file
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import Material
from neuralocks_core.runtime import StrandModel

from .behind import Behind
from .override import OverrideWriter, reload_open, to_text, used_files
from .posing import GroomPoser
from .spool import Spool, fingerprint
from .stage import Shot, StageGroom, read_shot
from .time_codes import time_codes

HALF = 0.5
"""Time codes to each side over which a velocity is measured."""


@dataclass(frozen=True)
class BakeResult:
    """What a bake did.

    Attributes:
        path: the override layer.
        frames: its time codes.
        grooms: per groom: path, strands, points, joint, how the joint was found.
        notes: what a user should know.
        seconds: wall time.
        resumed: frames taken over from an interrupted bake.
    """

    path: Path
    frames: list[float]
    grooms: list[dict]
    notes: list[str]
    seconds: float
    resumed: int


def bake(
    shot,
    out,
    model=None,
    grooms=None,
    skeleton: str | None = None,
    head: str | None = None,
    frames=None,
    *,
    subframes: int = 1,
    material=None,
    strength: float = 1.0,
    resolve: bool = False,
    velocities: bool = True,
    jobs: int | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> BakeResult:
    """Bake moving hair.

    Args:
        shot: path of a USD stage, or a `Shot` already read.
        out: `.usdc`, `.usd` or `.usda` to write.
        model: path of a strand model, or a StrandModel; the shipped one if left out.
        grooms: prim paths; all grooms if left out.
        skeleton: prim path of the skeleton; found if left out.
        head: joint that carries grooms for which no binding says so.
        frames: `A:B[:STEP]`, or time codes in any order; the shot's range if left out.
        subframes: samples per frame, for motion blur.
        material: a Material, or words NAME=VALUE.
        strength: motion strength from 0 (each pose as if held) to 1.
        resolve: push hair out of the body after the network.
        velocities: write velocities.
        jobs: threads; all cores if left out.
        progress: called with (done, total, message); raising from it stops the bake.

    Raises:
        NeuralocksError: what cannot be baked, in one line. Nothing is left under the output's name.
    """
    began = time.monotonic()
    out = Path(out)
    _check_out(out)
    jobs = _jobs(jobs)
    strand_model = _model(model, jobs)
    look = material if isinstance(material, Material) else Material.parse(_words(material))
    if not 0 <= strength <= 4:
        raise NeuralocksError(f"strength: {strength:g} is outside 0 to 4; 1 is what the model was trained for")
    shot = shot if isinstance(shot, Shot) else read_shot(shot, grooms, skeleton, head)
    codes = time_codes(frames, shot.first, shot.last, subframes)
    _check_not_input(out, shot)
    _check_space(out, shot, len(codes), velocities)
    say = progress or (lambda done, total, message: None)
    options = [look.log_ratios().tolist(), strength, resolve, velocities, skeleton, head]
    spool = Spool(
        out,
        fingerprint(
            used_files(shot.stage),
            {"model": _digest(strand_model), "options": options, "grooms": [g.path for g in shot.grooms]},
        ),
    )
    try:
        resumed = _write(shot, strand_model, look, strength, resolve, velocities, jobs, codes, spool, say)
    except KeyboardInterrupt:
        spool.close()
        raise
    except BaseException:
        spool.discard()
        raise
    described = [_described(item) for item in shot.grooms]
    return BakeResult(out, codes, described, list(shot.notes), time.monotonic() - began, resumed)


def _write(shot, model, material, strength, resolve, velocities, jobs, codes, spool, say) -> int:
    """Compute and write all samples; the number of frames taken over from an interrupted bake."""
    writer = OverrideWriter(spool.layer_path, spool.out, shot, codes)
    total, done, resumed = len(codes) * len(shot.grooms), 0, 0
    say(0, total, "reading")
    with Behind() as behind:
        for number, item in enumerate(shot.grooms):
            behind.put(writer.groom, item, velocities)
            frames = _Frames(shot, item, model, material, strength, resolve, velocities, jobs)
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
        behind.put(writer.sample, item, code, name, array)
        del array
    return there


class _Frames:
    """Samples of one groom in ascending order; the pose half-way between two frames is computed once."""

    def __init__(self, shot: Shot, item: StageGroom, model, material, strength, resolve, velocities, jobs):
        self._arguments = (item, model, material), {"strength": strength, "resolve": resolve, "jobs": jobs}
        self._poser: GroomPoser | None = None
        self.names = ("points", "velocities") if velocities else ("points",)
        self._rate = shot.border.rate
        clip = item.attachment.rig.time_codes
        moving = item.placement.samples[:1] + item.placement.samples[-1:]
        self._first, self._last = min([clip[0], *moving]), max([clip[-1], *moving])
        self._kept: tuple[float, np.ndarray] | None = None

    def at(self, code: float) -> Iterator[np.ndarray]:
        """Points, then velocities per second, (P, 3) float32; each can be let go before the next is made."""
        if self._poser is None:  # only now: a resumed bake may have nothing left to compute
            self._poser = GroomPoser(*self._arguments[0], **self._arguments[1])
        # Outside of its samples the animation stands still: differences are taken inside only, on one side at the ends.
        before, after = (min(max(t, self._first), self._last) for t in (code - HALF, code + HALF))
        wanted = len(self.names) == 2
        if wanted and after > before and (self._kept is None or self._kept[0] != before):
            self._kept = before, self._poser.points(before)
        yield self._poser.points(code)
        if not wanted:
            return
        if after <= before:
            yield np.zeros_like(self._poser.item.groom.points)
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


def _check_out(out: Path) -> None:
    if out.suffix.lower() not in (".usdc", ".usd", ".usda"):
        raise NeuralocksError(f"{out}: a bake is a USD layer; end its name with .usdc, .usd or .usda")
    if out.is_dir():
        raise NeuralocksError(f"{out}: is a folder; give a file name")


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


def _jobs(jobs: int | None) -> int:
    if jobs is None:
        return min(os.cpu_count() or 1, 8)
    if isinstance(jobs, bool) or not isinstance(jobs, int) or not 1 <= jobs <= 1024:
        raise NeuralocksError(f"--jobs {jobs}: must be a whole number from 1")
    return jobs


def _model(model, jobs: int) -> StrandModel:
    return model if isinstance(model, StrandModel) else StrandModel.load(model, threads=jobs)


def _words(material) -> list[str]:
    if material is None:
        return []
    if isinstance(material, dict):
        return [f"{name}={value}" for name, value in material.items()]
    return [material] if isinstance(material, str) else list(material)


def _digest(model: StrandModel) -> str:
    import hashlib

    digest = hashlib.sha256(repr(sorted(model.file.meta.items(), key=str)).encode())
    for name in model_file.KINDS["strands"]:
        digest.update(model.file.graphs[name])
    return digest.hexdigest()


def _described(item: StageGroom) -> dict:
    return {
        "path": item.path,
        "strands": item.groom.strand_count,
        "points": len(item.groom.points),
        "joint": item.joint,
        "how": item.attachment.how,
    }
