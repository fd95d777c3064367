# SPDX-License-Identifier: Apache-2.0
"""A bake by the reference solver instead of the network, for comparison: slow, and always from the first frame on."""

import re
import time
from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
from scipy.spatial import cKDTree

from neuralocks_core.arguments import flag
from neuralocks_core.deformation.lengths import keep_lengths
from neuralocks_core.deformation.resolve import Resolver
from neuralocks_core.deformation.root_skin import RootSkin
from neuralocks_core.errors import NeuralocksError, about
from neuralocks_core.evaluation.comparison import BLOWN, RUN_IN, simulated
from neuralocks_core.files import as_path
from neuralocks_core.materials import Material
from neuralocks_core.progress import Progress
from neuralocks_core.warp_device import start_warp

from ..border.amounts import check_number
from ..border.stage_files import check_layer_name
from ..shot.bakes.bake_record import given_facts
from ..shot.stage import StageGroom
from ..shot.wind import as_wind, in_core, wind_facts
from .bake import as_material
from .points.placing import GroomPlacer
from .procedure import BakeResult, known_notes, read_asked, write_told
from .samples import write_samples
from .stencils import Stencils

STRANDS = 2000
"""Strands simulated if no number is given."""
STIFFEST_VOLUME = 100.0
"""Nobody means a stiffer one, and the solver would take ever longer."""
MOST_SUBSTEPS = 500
"""With more, XPBD's errors grow again, see `simulate_xpbd`."""


def simulate(
    shot,
    out,
    *,
    grooms=None,
    skeleton: str | None = None,
    head: str | None = None,
    frames=None,
    joints: dict[str, str] | None = None,
    subframes: int = 1,
    material=None,
    wind=None,
    gusts: float | None = None,
    strands: int | None = None,
    volume: float = 0.0,
    xpbd: int | None = None,
    device: str = "cpu",
    loop: bool = False,
    cuts=None,
    tell: Callable[[list[str]], None] | None = None,
    progress: Progress | None = None,
) -> BakeResult:
    """Simulate a shot's hair and write it as a bake.

    Args:
        shot, out, grooms, skeleton, head, frames, joints, subframes, material, wind, gusts, loop, cuts, tell, progress: as
            for `bake`.
        strands: strands to simulate, in whole locks, 2000 if left out; the others follow the nearest of these and
            are pushed out of the body.
        volume: stiffness against strands crowding closer than in the groom [m^2/s^2]; models are trained without.
        xpbd: move the hair by XPBD (Macklin and others 2016) instead of the implicit solver, with so many substeps per 1/30 s,
            usually 10, 20 or 50. Its stretch is undone in the bake; it has no volume term and no clumping.
        device: where the solver runs: "cpu", "cuda" or "cuda:N".

    Raises:
        NeuralocksError: as `bake`, the solver is not installed, or the device is not there.
    """
    began = time.monotonic()
    out = as_path(out, "out")
    check_layer_name(out)
    look = as_material(material)
    count = STRANDS if strands is None else strands
    check_number("--strands", count, 1, whole=True)
    count = int(count)
    check_number("--volume", volume, 0, STIFFEST_VOLUME)
    if xpbd is not None:
        check_number("--xpbd", xpbd, 1, MOST_SUBSTEPS, whole=True)
        xpbd = int(xpbd)
        if volume:
            raise NeuralocksError(f"--volume {volume:g}: XPBD keeps no strands apart; leave out --volume or --xpbd")
    loop = flag("--loop", loop)
    blown = as_wind(wind, gusts)
    _check_device(device)
    reading = {"grooms": grooms, "skeleton": skeleton, "head": head, "joints": joints}
    shot, codes = read_asked(shot, reading, cuts, loop, frames, subframes, blown, progress)
    options = {"volume": float(volume), "loop": loop}
    solver = _solver_facts(xpbd, device)
    inputs = {"material": asdict(look), "wind": blown and asdict(blown), "codes": codes, "strands": count}
    inputs |= solver | options
    residuals: list[float] = []

    def poser(items: list[StageGroom]) -> _SimulatedPoser:
        (item,) = items
        how = {"volume": float(volume), "xpbd": xpbd, "device": device, "residuals": residuals, "progress": progress}
        wind = in_core(blown, shot.border)
        return _SimulatedPoser(item, codes, shot.first, look, count, wind=wind, loop=loop, **how)

    alike = {**solver, "material": asdict(look), "strands": count, **options, **wind_facts(blown)}

    def facts(item: StageGroom) -> dict:
        return alike | given_facts(shot.given_cuts(item.attachment.rig), shot.joints)

    notes = known_notes(shot, codes, loop)
    if xpbd and look.clumping != Material().clumping:
        notes.append("XPBD does not tie the strands of a lock together: the material's clumping does nothing")

    def write() -> int:
        how = {"blown": blown is not None, "progress": progress}
        return write_samples(shot, out, codes, poser, inputs, facts, **how)

    result = write_told(notes, tell, began, shot, out, codes, write)
    return replace(result, residual=None if xpbd else _summary(residuals))


def _check_device(device: str) -> None:
    """Refuse a device that is not there, before a shot is read for it."""
    if not (isinstance(device, str) and re.fullmatch(r"cpu|cuda(:\d+)?", device)):
        raise NeuralocksError(f"--device {device}: is none; write cpu, cuda or cuda:N")
    start_warp(device)


def _solver_facts(xpbd: int | None, device: str) -> dict:
    """What a bake records of the solver that made it. Devices round differently, whichever of a kind it is."""
    where = {} if device == "cpu" else {"device": device.partition(":")[0]}
    return ({"solver": "xpbd", "substeps": xpbd} if xpbd else {"solver": "rods"}) | where


def _summary(residuals: list[float]) -> dict | None:
    if not residuals:
        return None
    return {"median": float(np.median(residuals)), "worst": max(residuals), "steps": len(residuals)}


class _SimulatedPoser:
    """Points of one groom, from a simulation of some of its strands; `how` is as for `simulated`."""

    def __init__(self, item: StageGroom, codes: list[float], first: float, material, count: int, *, wind, loop, **how):
        self._rig, self._placer = item.attachment.rig, GroomPlacer(item)
        every = self._placer.strands
        chosen = every.whole_locks(count)
        if not len(chosen):
            raise NeuralocksError(f"{item.path}: no strand has two distinct points; there is nothing to simulate")
        codes = Stencils(item, codes, first, blown=wind is not None).codes
        clip = self._rig.cycle if loop else self._rig.clip
        seconds = self._rig.border.seconds(codes)
        # Simulation begins with the animation, whatever frames are wanted; before it, hair is at rest. A loop has no beginning, so
        # its wanted frames come after a run-in. A wind has none, either: hair moves in it before the animation.
        begins = clip.start - (RUN_IN if loop else BLOWN if wind else 0)
        wanted = clip.wrapped(seconds) if loop else np.maximum(seconds, begins)
        times = np.unique([begins, *wanted])
        self._row = dict(zip(codes, np.searchsorted(times, wanted), strict=True))
        character = item.attachment.character
        self._skin = RootSkin(character, [every], clip)
        begun = self._skin.begun(every)
        with about(self._rig.path):
            self._moved = simulated(character, begun.subset(chosen), clip, times, material, wind=wind, **how)
        mean = every.rest.mean(axis=1)
        self._chosen = chosen
        self._others = np.setdiff1d(np.arange(len(mean)), chosen)
        self._nearest = cKDTree(mean[chosen]).query(mean[self._others])[1]
        followers = begun.subset(self._others)
        self._resolver, self._rest = Resolver(character, followers, clip), followers.rest

    def points(self, time_code: float) -> np.ndarray:
        """(P, 3) float32, in the prim's own space and units."""
        joints, row = self._rig.joints_at(time_code), self._moved[self._row[time_code]]
        shape = self._rig.shape_at(time_code)
        moved = np.empty((len(self._chosen) + len(self._others), *row.shape[1:]), np.float32)
        moved[self._chosen], moved[self._others] = row, row[self._nearest]
        self._skin.carry(moved, shape, lambda moved: self._push(moved, joints, shape))
        return self._placer.points(time_code, joints, lambda strands: moved[strands])

    def _push(self, moved: np.ndarray, joints: np.ndarray, shape: np.ndarray) -> None:
        """Push the following strands out of the body, in place: the solver kept only the strands that they follow out of it. Their
        lengths come first, since what moves another strand as it should stretches them, and restored afterwards they go in again.
        """
        followed = keep_lengths(self._rest, moved[self._others], smooth=False)
        self._resolver.apply(followed, joints, shape)
        moved[self._others] = followed
