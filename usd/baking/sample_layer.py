# SPDX-License-Identifier: Apache-2.0
"""A new crate file that is written sample by sample: its memory does not grow with their number."""

from pathlib import Path

from pxr import Sdf, Vt

from ..border.damage import named

SAVE_EVERY = 32 << 20
"""Bytes of samples held before they are saved."""


class SampleLayer:
    """A layer with time samples of arrays of vectors, which are saved now and then.

    Args:
        part: file to write now.
        out: its final name, which errors tell.

    Attributes:
        layer: for all that is no sample.
    """

    def __init__(self, part: Path, out: Path):
        self._out = out
        part.unlink(missing_ok=True)
        with named(out):
            self.layer = Sdf.Layer.CreateNew(str(part), {"format": "usdc"})
        self._held = 0

    def put(self, prim: Sdf.Path, time_code: float, values: dict[str, Vt.Vec3fArray]) -> None:
        """Add a time sample to each of some attributes of a prim."""
        with named(self._out):
            for name, array in values.items():
                self.layer.SetTimeSample(prim.AppendProperty(name), float(time_code), array)
                self._held += 12 * len(array)
            if self._held >= SAVE_EVERY:
                self._save()

    def close(self) -> None:
        """Write what is held."""
        with named(self._out):
            self._save()
        self.layer = None

    def _save(self) -> None:
        self.layer.Save()
        self._held = 0


class Lagging:
    """The order in which a groom's samples come: the velocity of a time code after the points of the two frames that
    follow it and are written, which it is made of where they are computed at all.

    A file is thus the same whether it was baked at once or joined of parts.

    Args:
        frame: time codes from one frame to the next.
    """

    def __init__(self, frame: float):
        self._lag, self._waiting = 2 * frame - 1e-6, []

    def after(self, code: float) -> list[float]:
        """Whose velocities come now that the points of `code`, later than any before, are written."""
        due = [c for c in self._waiting if c + self._lag <= code]
        self._waiting = [*self._waiting[len(due) :], code]
        return due

    def rest(self) -> list[float]:
        """Whose velocities come last."""
        return self._waiting
