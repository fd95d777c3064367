# SPDX-License-Identifier: Apache-2.0
"""A crate file that is written sample by sample, so that memory does not grow with their number."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from pxr import Sdf, Vt

from neuralocks_core.files import cannot_write

from ...border.damage import named
from .save_log import SaveLog

SAVE_EVERY = 32 << 20
"""Bytes of samples held before they are saved."""


class SampleLayer:
    """A layer with time samples of arrays of vectors, saved from time to time.

    When it saves depends only on the samples, so the file is the same whether it was written in one go or resumed.

    Args:
        part: file to write now.
        out: its final name, for error messages.
        log: of the file, which makes it resumable; none if left out.
        puts: how many samples are in it already; 0 writes a new file.

    Attributes:
        layer: for everything except samples.
        saved: how many samples are in the file and its log.
    """

    def __init__(self, part: Path, out: Path, log: SaveLog | None = None, puts: int = 0):
        self._part, self._out, self._log, self._puts = part, out, log, puts
        self.saved, self._held = puts, 0
        with self._named():
            if puts:
                self.layer = Sdf.Layer.FindOrOpen(str(part))
                return
            part.unlink(missing_ok=True)
            self.layer = Sdf.Layer.CreateNew(str(part), {"format": "usdc"})
            if log is not None:
                log.begin()

    def put(self, prim: Sdf.Path, time_code: float, values: dict[str, Vt.Vec3fArray]) -> None:
        """Add a time sample to each of some attributes of a prim."""
        with self._named():
            for name, array in values.items():
                self.layer.SetTimeSample(prim.AppendProperty(name), float(time_code), array)
                self._held += 12 * len(array)
            self._puts += 1
            if self._held >= SAVE_EVERY:
                self._save()

    def close(self) -> None:
        """Write what is held."""
        with self._named():
            self._save()
        self.layer = None

    def _save(self) -> None:
        self.layer.Save()
        self._held = 0
        if self._log is None or self._log.add(self._part, self._puts):
            self.saved = self._puts

    @contextmanager
    def _named(self) -> Iterator[None]:
        try:
            with named(self._out):
                yield
        except OSError as error:
            raise cannot_write(self._out, error) from None


def in_order(codes: Sequence[float], frame: float, velocities: bool = True) -> Iterator[tuple[str, float]]:
    """The order in which a groom's samples come: a velocity comes after the points of the next two frames, if those are baked.

    So a file is the same whether it was baked in one go or joined from parts.

    Args:
        codes: ascending time codes.
        frame: time codes from one frame to the next.
        velocities: whether there are any. They are computed from the points of neighbouring frames.

    Yields:
        "points" or "velocities", and the time code.
    """
    waiting = list(codes) if velocities else []
    for code in codes:
        yield "points", code
        while waiting and waiting[0] + 2 * frame - 1e-6 <= code:
            yield "velocities", waiting.pop(0)
    for code in waiting:
        yield "velocities", code
