# SPDX-License-Identifier: Apache-2.0
"""The two training methods behind one interface: regression on rollouts of the solver, and the physics of random moments."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from neuralocks_core.deformation.strand_session import strand_inputs
from neuralocks_core.strands.strand_set import StrandSet
from neuralocks_core.training.data.farm import RolloutFarm
from neuralocks_core.training.data.moments import MOMENTS, MomentPool
from neuralocks_core.training.data.rollouts import TrainingScene
from neuralocks_core.training.descent import Descended
from neuralocks_core.training.learning.moment_options import SelfSupervisedOptions
from neuralocks_core.training.learning.regression import FIRST, RolloutBank, regress
from neuralocks_core.training.learning.regression_options import RegressionOptions
from neuralocks_core.training.learning.selfsupervised import train_on_moments
from neuralocks_core.training.networks import StrandNet

STEPS_EACH = 10
"""Steps per further clip, in a run with a given number of steps: about as many as two cores take while one clip is made."""
LOOK_AGAIN = 0.2
"""How long to wait before looking for further clips [s]."""


def method_of(
    scene: TrainingScene,
    codes: Callable[[StrandSet], np.ndarray],
    options: RegressionOptions | SelfSupervisedOptions,
    farm: RolloutFarm,
    report: Callable[..., None],
) -> RolloutMethod | MomentMethod:
    """The method that the kind of options asks for; `codes` as for `RolloutBank`; for the rest see `train.train_strands`."""
    kind = MomentMethod if isinstance(options, SelfSupervisedOptions) else RolloutMethod
    return kind(scene, codes, options, farm, report)


class RolloutMethod:
    """Regression on rollouts that a farm makes at the same time; see `regression`."""

    name = "regression on rollouts of the reference solver"

    def __init__(self, scene, codes, options: RegressionOptions, farm, report):
        self.options, self.farm = options, farm
        self.bank = RolloutBank(scene, codes)
        self.inputs = self.bank.inputs
        self._report = report
        wait(farm, min(FIRST, farm.count), self._first)
        self.bank.add(self._at_step(0) if options.steps else farm.files())

    def samples(self) -> tuple[np.ndarray, np.ndarray]:
        """Strand inputs (n, 142) and boundary vectors (m, F) as they occur in training."""
        return samples(self.bank)

    def train(self, net: StrandNet, optimisers, **since) -> Iterator[Descended]:
        """See `regression.regress`."""
        return regress(self.bank, net, self.options, optimisers, self.farm.files, at_step=self._at_step, **since)

    def _first(self, there: int, count: int) -> None:
        """Report waiting separately: its speed says nothing about the training after it."""
        self._report(there / count, f"first simulations: {there} of {count}", count)

    def _at_step(self, step: int) -> list[Path]:
        """New rollouts for a step of a run with a given number of steps, however fast the farm is; waits for them."""
        count, farm = min(FIRST + step // STEPS_EACH, self.farm.count), self.farm
        if count == self.bank.read:
            return []
        done = step / self.options.steps
        says = f"{step} steps, simulations: "
        wait(farm, count, lambda there, count: self._report(done, f"{says}{there} of {count}"), numbered=True)
        return farm.files(count)

    def material(self) -> str:
        """Short text about the training material."""
        return f"{self.bank.read} rollouts"

    def card(self) -> dict:
        """Entries for the model card."""
        residual = float(np.median([r.residual for r in self.bank.rollouts]))
        return {"rollouts": self.bank.read, "solver residual": residual}


class MomentMethod:
    """The physics of random moments; see `selfsupervised`."""

    name = "self-supervised on the potentials of random moments"

    def __init__(self, scene, codes, options: SelfSupervisedOptions, farm, report):
        self.options = options
        self.inputs = [strand_inputs(groom, codes(groom)) for groom in scene.grooms]
        self.pool = MomentPool(
            replace(scene, strands=options.strands),
            supported=options.supported,
            nearest_vertices=options.paper_adhesion,
            volume=options.volume > 0,
        )
        for i in range(FIRST):
            report(0.0, f"first motions: {i} of {FIRST}")
            self.pool.grow()

    def samples(self) -> tuple[np.ndarray, np.ndarray]:
        """Strand inputs (n, 142) and boundary vectors (m, F) as they occur in training."""
        frames = np.concatenate([m.vectors for m in self.pool.moments])
        if not self.options.random_materials:
            frames[:, self.pool.scene.spec.slices["material"]] = 0
        return np.concatenate([inputs[:: max(1, len(inputs) // 500)] for inputs in self.inputs]), frames

    def train(self, net: StrandNet, optimisers, **since) -> Iterator[Descended]:
        """See `selfsupervised.train_on_moments`."""
        return train_on_moments(self.pool, self.inputs, net, self.options, optimisers, **since)

    def material(self) -> str:
        """Short text about the training material."""
        return f"{len(self.pool.moments)} moments"

    def card(self) -> dict:
        """Entries for the model card."""
        return {"moments": len(self.pool.moments), "clips": len(self.pool.moments) // MOMENTS}


def samples(bank: RolloutBank) -> tuple[np.ndarray, np.ndarray]:
    """Strand inputs (n, 142) and boundary vectors (m, F) of a bank's rollouts."""
    strands = np.concatenate([bank.inputs[r.groom][r.strands] for r in bank.rollouts])
    strands = np.concatenate([strands, *(inputs[:: max(1, len(inputs) // 500)] for inputs in bank.inputs)])
    frames = []
    for r in bank.rollouts:
        frames.append(r.vectors.copy())
        frames[-1][:, bank.material] = r.materials[np.arange(len(r.vectors)) % len(r.materials)]
    return strands, np.concatenate(frames)


def wait(farm: RolloutFarm, count: int, say: Callable[[int, int], None], numbered: bool = False) -> None:
    """Wait until a farm has made `count` rollouts, or if `numbered` the first `count`; `say` gets their number, and `count`.

    Raises:
        NeuralocksError: a process of the farm failed.
    """
    while True:
        alive = farm.alive  # before the count: a process may save its last and end between the two
        if (there := len(farm.files(count if numbered else None))) >= count:
            return
        if farm.failed() or not alive:
            raise farm.failure()
        say(there, count)
        time.sleep(LOOK_AGAIN)
