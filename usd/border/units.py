# SPDX-License-Identifier: Apache-2.0
"""Where a stage's unit, up axis and rate are converted to metres, Y up and seconds: once, here."""

import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Ar, Sdf, Tf, Usd, UsdGeom

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path, atomic_write
from neuralocks_core.formats import EXTENSIONS

from .damage import first_line, named
from .stopping import check

LAYERS = (".usd", ".usda", ".usdc")
OTHERS = (".fbx", ".vrm", ".glb", ".gltf")
"""Characters in other formats, which USD reads with plug-ins alone."""
SLOWEST, FASTEST = 12.0, 600.0
"""Time codes per second between which one time code is a frame, of a slow-motion camera too; other stages count
seconds, or milliseconds."""


@dataclass(frozen=True)
class Border:
    """Unit, up axis and rate of one stage.

    Attributes:
        metres_per_unit: length of one stage unit [m].
        up_axis: "Y" or "Z".
        rate: time codes per second.
        frame: time codes from one frame to the next.
    """

    metres_per_unit: float
    up_axis: str
    rate: float
    frame: float = 1.0

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
        """A remark where an attribute's layer counts in another unit or axis: references convert neither. '' if not."""
        for spec in attribute.GetPropertyStack(Usd.TimeCode.EarliestTime()):
            if differs := self._other_axis(spec.layer) if axis_only else self.differing(spec.layer):
                name = spec.layer.GetDisplayName()
                return f" (its layer {name} {differs}: USD converts neither, the prim needs a transform)"
        return ""

    def differing(self, layer: Sdf.Layer) -> str:
        """In which unit and axis a layer is written, where they are not these; '' if it says nothing else."""
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

    def seconds(self, time_codes) -> np.ndarray:
        """Times [s] of time codes."""
        return np.asarray(time_codes, float) / self.rate

    @classmethod
    def of(cls, stage: Usd.Stage) -> "Border":
        """Read and check the stage's metadata.

        Raises:
            NeuralocksError: the unit, axis or rate cannot be meant.
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
            raise NeuralocksError(f"{name}: timeCodesPerSecond is {rate:g}; set it to the frame rate, 24 say")
        shown = stage.GetFramesPerSecond()
        frame = 1.0 if usual(rate) else rate / (shown if usual(shown) else 24.0)
        return cls(unit, up, rate, frame)


def open_stage(path) -> Usd.Stage:
    """Open a USD file.

    Raises:
        NeuralocksError: it is missing, or no readable USD file.
    """
    path = as_path(path, "path")
    if not path.exists():
        raise NeuralocksError(f"{path}: no such file; check the path")
    if path.is_dir():
        raise NeuralocksError(f"{path}: is a folder; name the USD file in it")
    if path.suffix.lower() in EXTENSIONS:
        raise NeuralocksError(
            f"{path}: is a hair file; make a USD groom of it with 'neuralocks import' and add that to a shot"
        )
    check()  # USD swallows Ctrl-C while it loads its modules
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise NeuralocksError(f"{path}: not a readable USD file ({first_line(error)}); {_remedy(path)}") from None
    if stage is None:
        raise NeuralocksError(f"{path}: not a readable USD file; {_remedy(path)}")
    return stage


def _remedy(path: Path) -> str:
    if path.suffix.lower() not in OTHERS:
        return "export it again"
    by = " (examples/vrm_to_usd.py does)" if path.suffix.lower() != ".fbx" else ""
    return f"import it into Blender and export USD there{by}"


def used_files(stage: Usd.Stage) -> list[str]:
    """Files that the stage is composed of."""
    # What lies inside a package is of the package's file.
    paths = (layer.realPath for layer in stage.GetUsedLayers())
    return sorted({Ar.SplitPackageRelativePathOuter(path)[0] for path in paths if path})


def check_layer_name(out: Path) -> None:
    """Refuse to write USD under a name that is no USD layer's.

    Raises:
        NeuralocksError: it has another ending, is a folder's, or says more to USD than a name.
    """
    if ":SDF_FORMAT_ARGS:" in str(out):
        raise NeuralocksError(f"{out}: USD takes what follows :SDF_FORMAT_ARGS: for arguments; choose another name")
    if out.suffix.lower() not in LAYERS:
        raise NeuralocksError(f"{out}: is written as a USD layer; end its name with {', '.join(LAYERS)}")
    if os.path.isdir(out):  # False of a name too long for a file, too, which is told when it is written
        raise NeuralocksError(f"{out}: is a folder; give a file name")


def check_not_input(out: Path, stage: Usd.Stage) -> None:
    """Refuse to write over a file that the stage is composed of.

    Raises:
        NeuralocksError: `out` is one of them, by whatever name.
    """
    if any(one_file(out, path) for path in used_files(stage)):
        raise NeuralocksError(f"{out}: is part of the shot itself; choose another name")


def one_file(out: Path, path: str | Path) -> bool:
    """Whether a file that will be written is one that there is; folders on the way to it may still be missing."""
    if not os.path.exists(path):
        return False
    return os.path.realpath(out) == os.path.realpath(path) or (os.path.exists(out) and os.path.samefile(out, path))


def write_stage(path: Path, author: Callable[[Usd.Stage], None]) -> Path:
    """Write a new USD file at once under its final name, with what `author` puts into the stage.

    Raises:
        NeuralocksError: the path has another ending, or cannot be written.
    """
    check_layer_name(path)
    with named(path), atomic_write(path) as part:
        stage = Usd.Stage.CreateNew(str(part))
        author(stage)
        stage.GetRootLayer().Save()
        del stage
        check()
    return path
