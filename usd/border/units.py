# SPDX-License-Identifier: Apache-2.0
"""Where a stage's unit, up axis and rate are converted to metres, Y up and seconds: once, here."""

import math
from dataclasses import dataclass, replace

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from neuralocks_core.errors import NeuralocksError

SLOWEST, FASTEST = 12.0, 600.0
"""Between these time codes per second, one time code is a frame, also of a slow-motion camera; other stages count seconds, or
milliseconds."""
USUAL = 24.0
"""Frames per second of a stage that does not tell them, neither by its time codes nor by framesPerSecond."""


@dataclass(frozen=True)
class Border:
    """Unit, up axis and rate of one stage.

    Attributes:
        metres_per_unit: length of one stage unit [m].
        up_axis: "Y" or "Z".
        rate: time codes per second.
        frame: time codes from one frame to the next.
        guessed: whether the stage does not tell `frame`, so that USUAL frames per second are assumed.
    """

    metres_per_unit: float
    up_axis: str
    rate: float
    frame: float = 1.0
    guessed: bool = False

    @property
    def to_core(self) -> np.ndarray:
        """Transform (4, 4) from stage world space to metres, Y up.

        A Z-up character looks along -Y by convention; that becomes +Z.
        """
        turn = np.eye(4)
        if self.up_axis == "Z":
            turn[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
        turn[:3] *= self.metres_per_unit
        return turn

    @property
    def from_core(self) -> np.ndarray:
        """Transform (4, 4) from metres, Y up, to stage world space."""
        return np.linalg.inv(self.to_core)

    def foreign(self, attribute: Usd.Attribute, *, axis_only: bool = False) -> str:
        """A remark if an attribute's layer has another unit or axis, since references convert neither; '' if not."""
        for spec in attribute.GetPropertyStack(Usd.TimeCode.EarliestTime()):
            if differs := self._other_axis(spec.layer) if axis_only else self.differing(spec.layer):
                name = spec.layer.GetDisplayName()
                return f" (its layer {name} {differs}: USD converts neither, the prim needs a transform)"
        return ""

    def differing(self, layer: Sdf.Layer) -> str:
        """In which unit and axis a layer is written, if they differ from these; '' if they do not."""
        root, said = layer.pseudoRoot, []
        unit = root.GetInfo("metersPerUnit") if root.HasInfo("metersPerUnit") else self.metres_per_unit
        if abs(unit / self.metres_per_unit - 1) > 1e-3:
            said.append(f"counts in {unit:g} m, the stage in {self.metres_per_unit:g} m")
        return " and ".join([*said, *filter(None, [self._other_axis(layer)])])

    def _other_axis(self, layer: Sdf.Layer) -> str:
        root = layer.pseudoRoot
        if not root.HasInfo("upAxis") or root.GetInfo("upAxis") == self.up_axis:
            return ""
        return f"has {root.GetInfo('upAxis')} up, the stage {self.up_axis}"

    def frame_notes(self, subject: str) -> list[str]:
        """The note on a stage that does not tell how long a frame is, beginning with `subject`."""
        if not self.guessed:
            return []
        return [
            f"{subject}: timeCodesPerSecond is {self.rate:g} and framesPerSecond is not authored, so a second counts as "
            f"{USUAL:g} frames; author framesPerSecond"
        ]

    def seconds(self, time_codes) -> np.ndarray:
        """Times [s] of time codes."""
        return np.asarray(time_codes, float) / self.rate

    def time_codes(self, seconds) -> np.ndarray:
        """Time codes of times [s]."""
        return np.asarray(seconds, float) * self.rate

    def unless_told(self, stage: Usd.Stage) -> "Border":
        """That of a stage that is read beside this one's; what it does not tell is as here."""
        other = Border.of(stage)
        unit = other.metres_per_unit if stage.HasAuthoredMetadata("metersPerUnit") else self.metres_per_unit
        up = other.up_axis if stage.HasAuthoredMetadata("upAxis") else self.up_axis
        return replace(other, metres_per_unit=unit, up_axis=up)

    @classmethod
    def of(cls, stage: Usd.Stage) -> "Border":
        """Read and check the stage's metadata.

        Raises:
            NeuralocksError: the unit, axis or rate makes no sense.
        """

        def usual(rate: float) -> bool:
            return SLOWEST <= rate <= FASTEST

        name = stage.GetRootLayer().GetDisplayName()
        unit = float(UsdGeom.GetStageMetersPerUnit(stage))
        if not (math.isfinite(unit) and 1e-7 < unit < 1e7):
            raise NeuralocksError(
                f"{name}: metersPerUnit is {unit:g}; set it to the length of a unit in metres (0.01 for cm)"
            )
        up = str(UsdGeom.GetStageUpAxis(stage)).upper()
        if up not in ("Y", "Z"):
            raise NeuralocksError(f"{name}: upAxis is '{up}'; set it to Y or Z")
        rate = float(stage.GetTimeCodesPerSecond())
        if not (math.isfinite(rate) and 1e-3 < rate < 1e6):
            raise NeuralocksError(f"{name}: timeCodesPerSecond is {rate:g}; set it to the frame rate, such as 24")
        shown = float(stage.GetFramesPerSecond()) if stage.HasAuthoredMetadata("framesPerSecond") else math.nan
        # With both at 1, a stage still counts seconds.
        if usual(rate) or rate == shown > 1:
            return cls(unit, up, rate)
        return cls(unit, up, rate, rate / (shown if usual(shown) else USUAL), not usual(shown))
