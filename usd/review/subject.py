# SPDX-License-Identifier: Apache-2.0
"""What is measured of one groom of a bake, and of the same strands simulated."""

from functools import cached_property

import numpy as np

from neuralocks_core import metrics
from neuralocks_core.deformation.root_skin import RootSkin
from neuralocks_core.deformation.strand_session import StrandSession
from neuralocks_core.evaluation import comparison
from neuralocks_core.evaluation.pose_energies import energies, stretch_energy
from neuralocks_core.materials import Material
from neuralocks_core.models.network_sizes import K
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.motion import GRAVITY, Clip, G
from neuralocks_core.strands.arclength import arc_lengths
from neuralocks_core.strands.centreline import passes, smoothed
from neuralocks_core.strands.strand_set import CLAMPED, StrandSet, strands_on
from neuralocks_core.wind import Wind

from ..shot.bakes.bake_record import recorded, recorded_volume
from ..shot.stage import StageGroom
from ..shot.wind import recorded_wind
from .baked import Baked
from .own_bends import OwnBends

STRANDS = 600
"""Strands measured of each groom, in whole locks; lengths are measured on all."""
REFERENCE_STRANDS = 200
WOUND = 1.2
"""A strand this many times as long as the line of its network vertices is a coil. If it only has a kink, its points show the line's
motion better than smoothed ones would."""
TURN_FRAMES = 32
"""Angles between edges are measured in about this many frames."""
COLLISION_VERTICES, COLLISION_POINTS = 200_000, 6_400_000
"""Most of the groom's own vertices that are measured, evenly along the strands, and most positions of them in all frames."""


class Subject:
    """One groom of a bake, read once: lengths of all strands, displacements of some."""

    def __init__(self, baked: Baked, item: StageGroom, say):
        self.baked, self.item, self.say = baked, item, say
        self.character, groom = item.attachment.character, item.groom
        every = strands_on(self.character, groom)
        rig = item.attachment.rig
        skin, shapes = RootSkin(self.character, [every], rig.clip), baked.shapes(rig)
        begun = skin.begun(every)
        # The solver moves the strands that seed 0 chooses; another seed also measures strands that follow them.
        self.chosen = every.whole_locks(STRANDS, seed=int("solver" in recorded(item.prim)))
        self.strands: StrandSet = every.subset(self.chosen)
        self.begun = begun.subset(self.chosen)
        arc, length = arc_lengths(groom)
        self._within(groom, arc, length)
        rest = self.character.canonical(groom.points.astype(float))
        rest_lengths = metrics.strand_lengths(rest, groom.counts)
        count, total = len(self.chosen), len(baked.codes)
        # The points of a coil also turn about its line, but only the line's motion is measured.
        wound = length[self.chosen] > WOUND * self.strands.length
        times = np.where(wound, passes(self._sampled(rest)), 0)
        self.moved = np.zeros((total, count, K, 3), np.float32)
        self.own_rest = rest[self._own] + (begun.rest[:, 0] - every.rest[:, 0])[groom.strand_of_point[self._own]]
        self.own = np.zeros((total, len(self._own), 3), np.float32)
        self.bends = OwnBends(groom, self.chosen, arc, rest, total)
        sums, taut = [], []
        edges_at_rest = self._edge_lengths(rest)
        for frame in range(total):
            points = baked.canonical(item, frame)
            sums.append(metrics.stretch(metrics.strand_lengths(points, groom.counts)[None], rest_lengths))
            taut.append(stretch_energy(self._edge_lengths(points)[None], edges_at_rest)[0])
            offset = points - rest
            self.moved[frame] = smoothed(self._sampled(offset), times)
            if skin.moves:  # hair is measured relative to the skin that it is on
                self.moved[frame] -= skin.moved(shapes[frame])[self.chosen]
            self.own[frame] = points[self._own]
            self.bends.read(frame, offset)
            say(frame + 1, total, f"reading {item.path}")
        self.stretch = {
            key: float(max(s[key] for s in sums) if key.endswith("max") else np.mean([s[key] for s in sums]))
            for key in sums[0]
        }
        self.stretch_energy = float(np.mean(taut))

    def _within(self, groom, arc: np.ndarray, length: np.ndarray) -> None:
        """Find where the chosen strands' network vertices lie between own vertices, and which movable own vertices to measure."""
        self._low = np.zeros((len(self.chosen), K), int)
        self._part = np.zeros((len(self.chosen), K, 1))
        own, edges = [], []
        for row, strand in enumerate(self.chosen):
            start, count = int(groom.starts[strand]), int(groom.counts[strand])
            mine = arc[start : start + count]
            wanted = np.linspace(0, length[strand], K)
            low = np.clip(np.searchsorted(mine, wanted, side="right") - 1, 0, count - 2)
            span = np.maximum(mine[low + 1] - mine[low], 1e-12)
            self._low[row] = start + low
            self._part[row, :, 0] = np.clip((wanted - mine[low]) / span, 0, 1)
            free = mine > length[strand] * (CLAMPED - 1) / (K - 1) * 1.001
            own.append(start + np.flatnonzero(free))
            edges.append(np.arange(start, start + count - 1))
        movable = np.concatenate(own) if own else np.zeros(0, int)
        most = min(len(movable), COLLISION_VERTICES, COLLISION_POINTS // max(len(self.baked.codes), 1))
        self._own = movable[np.linspace(0, len(movable) - 1, most).round().astype(int)]
        self._edges = np.concatenate(edges) if edges else np.zeros(0, int)

    def _sampled(self, values: np.ndarray) -> np.ndarray:
        """Values (P, 3) of the whole groom at the chosen strands' network vertices (S, K, 3)."""
        return values[self._low] * (1 - self._part) + values[self._low + 1] * self._part

    def _edge_lengths(self, points: np.ndarray) -> np.ndarray:
        """Lengths (E,) of the chosen strands' own edges [m]; points (P, 3) of the whole groom."""
        return np.linalg.norm(points[self._edges + 1] - points[self._edges], axis=1)

    def measures(self, material: Material, depths: dict) -> dict:
        """Everything that needs no reference, with its `depths`; for a groom without hair, only the counts."""
        baked, times = self.baked, self.baked.times
        result = {"strands": self.item.groom.strand_count, "measured": len(self.chosen), "frames": len(baked.codes)}
        if not len(self.chosen):
            return result
        strands, length = self.strands, np.maximum(self.strands.length, 1e-6)
        joints = baked.joints(self.item.attachment.rig)
        turn = self.character.canonical_to_world(joints)[:, :3, :3]
        down = np.einsum("tji,j->ti", turn / np.cbrt(np.linalg.det(turn))[:, None, None], GRAVITY / G)
        result |= {**self.stretch, **depths, "droop_cm": metrics.droop(self.moved, down)}
        if len(times) >= 3:
            tips = self.moved[:, :, -1] - self.moved[:, :, -1].mean(axis=0)
            swing = np.sqrt(np.square(tips).sum(axis=2).mean(axis=0)) / length
            speed = metrics.speed(self.moved, times, self._cuts)
            result["speed_cm_s"] = 100 * float(speed.mean()) if len(speed) else float("nan")
            result["swing_percent"] = 100 * float(swing.mean())
            result |= self._stops(joints)
        result["turn_degrees"] = metrics.turning(strands.rest + self.moved[:: max(1, len(times) // TURN_FRAMES)])
        result["turn_at_rest_degrees"] = metrics.turning(strands.rest)
        sums = energies(strands.rest + self.moved, strands.rest, down, material)
        result |= {f"energy_{name}": float(np.mean(value)) for name, value in sums.items()}
        if not self.bends.fine.all():
            result["energy_bend"] = self.bends.energy(self.moved, strands.rest, material)
        return result | {"energy_stretch": self.stretch_energy}

    def _stops(self, joints) -> dict:
        """Settling after the longest stop, and what still moves once it should be over."""
        times = self.baked.times
        still = metrics.held(joints, times)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
        runs = [(a - 1, b - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]
        runs = [(a, b) for a, b in runs if times[b] - times[a] >= 0.5]
        if not runs or (self._wind and self._wind.gusts):  # in gusts, no hair comes to rest
            return {"settling_s": float("nan"), "jitter_mm": float("nan")}
        moved_before = [(a, b) for a, b in runs if a > 0] or runs
        a, b = max(moved_before, key=lambda run: times[run[1]] - times[run[0]])
        quiet = [np.flatnonzero((times >= times[a] + metrics.QUIET_AFTER) & (times <= times[b])) for a, b in runs]
        quiet = [frames for frames in quiet if len(frames) > 1]
        return {
            "settling_s": metrics.settling_time(self.moved[a : b + 1], times[a : b + 1], times[a]),
            "jitter_mm": max(metrics.jitter(self.moved[frames]) for frames in quiet) if quiet else float("nan"),
        }

    def crowded(self) -> list[str]:
        """The note on hair that was kept apart, if the reference has only some of its strands."""
        few, every = len(self.strands.whole_locks(REFERENCE_STRANDS)), len(self.strands.length)
        if not self.volume or few == every:
            return []
        return [
            f"{self.item.path}: its {every} strands were kept apart (--volume {self.volume:g}), the reference's {few} crowd less, so it "
            "differs from a simulation by more than its motion"
        ]

    @property
    def volume(self) -> float:
        """How strongly the bake records that strands were kept apart."""
        return recorded_volume(self.item.prim)

    def compared(self, material: Material, model: StrandModel | None) -> tuple[dict, dict]:
        """Rows and tip curves compared with the reference."""
        strands, times = self.strands, self.baked.times
        few = strands.whole_locks(REFERENCE_STRANDS)
        some = self.begun.subset(few)
        clip = self._clip
        # The network knows what came before the first frame baked, so the reference must, too.
        begun = times[0] - comparison.RUN_IN
        if not clip.loop:
            begun = max(min(times[0], clip.start), begun)
        known = np.concatenate([[begun], times])
        if self._wind and not clip.loop:
            known[0] -= comparison.BLOWN
        felt = {"wind": self._wind, "volume": self.volume}
        true = comparison.simulated(self.character, some, clip, known, material, **felt, progress=self.say)[1:]
        answers = {"bake": self.moved[:, few], "held pose": self._held(material, model, few)}
        answers["rigid"] = np.zeros_like(true)
        measured = (true, some.length, times, self._cuts)
        rows = {who: comparison.compare(a, *measured) for who, a in answers.items() if a is not None}
        tips = {who: metrics.tip_curves(a) for who, a in answers.items() if a is not None}
        return rows, tips | {"reference": metrics.tip_curves(true)}

    def _held(self, material: Material, model: StrandModel | None, few) -> np.ndarray | None:
        """The model's answer for each pose as if it were held, in the wind, if there is a model."""
        if model is None:
            return None
        session = StrandSession(model, self.strands)
        sampler = model.sampler(self.character, self._clip)
        ratios = material.log_ratios()
        session.anchor(sampler.held_bind(ratios))
        vectors = sampler.vectors(self.baked.times, ratios, 0.0, wind=self._wind if model.feels_wind else None)
        return np.stack([session.displacement(vector)[few] for vector in vectors])

    @cached_property
    def _wind(self) -> Wind | None:
        """That the bake was made in."""
        return recorded_wind(self.item.prim, self.item.attachment.rig.border)

    @cached_property
    def _clip(self) -> Clip:
        """The motion; a loop if the bake records that it was one."""
        rig = self.item.attachment.rig
        return rig.cycle if recorded(self.item.prim).get("loop") else rig.clip

    @property
    def _cuts(self) -> np.ndarray:
        """When hair starts anew (C,) [s]."""
        return np.array([part.start for part in self._clip.parts[1:]])
