# SPDX-License-Identifier: Apache-2.0
"""A run of so many minutes or steps: when it is kept, and how much of its budget is left to one that goes on."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("torch", reason="the extra 'train' is not installed")

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models.network_sizes import STRAND
from neuralocks_core.training import run
from neuralocks_core.training.data.rollouts import TrainingScene
from neuralocks_core.training.descent import Descended
from neuralocks_core.training.learning.regression_options import RegressionOptions
from neuralocks_core.training.run import HELD, Run
from tests.core.rigs import person, straight_hair

SCENE = TrainingScene(person(), (straight_hair(20),))


class Method:
    """Stands in for a method that has got so far after so many seconds of a clock of its own."""

    name = "stand-in"

    def __init__(self, clock, states, **budget):
        self.options = RegressionOptions(**budget, motion="linear", strand_map="linear", optimiser="adamw")
        self._clock, self._states = clock, states

    def samples(self):
        rng = np.random.default_rng(0)
        return [rng.normal(size=(9, size)).astype(np.float32) for size in (STRAND, SCENE.spec.size)]

    def train(self, net, optimisers, *, step, done):
        self.began = step, done
        for seconds, more, share in self._states if done < 1 else ():
            self._clock.now += seconds
            yield Descended(step + more, share, {"x": 0.5})

    def material(self):
        return "7 somethings"

    def card(self):
        return {}


class Farm:
    count = 2

    def __init__(self, there=0):
        self.there = there

    def files(self):
        return [None] * self.there

    def failed(self):
        return False


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Trains for the states given; returns the run, its method, its gauges and what it had kept at each state."""
    clock = SimpleNamespace(now=1000.0)
    monkeypatch.setattr(run, "time", SimpleNamespace(monotonic=lambda: clock.now))
    monkeypatch.setattr(run, "measure", lambda *_: SimpleNamespace(to_json=lambda: {"motion": 0.4}))

    def waited(farm, count, say):
        farm.there = count
        say(1, count)

    monkeypatch.setattr(run, "wait", waited)

    def train(states, held=None, resume=False, farm=None, **budget):
        clock.now += 500.0  # between two runs
        method, kept = Method(clock, states, **budget), []
        bank = SimpleNamespace(add=lambda files: None, rollouts=[0])
        one = Run(SCENE, method, bank, tmp_path / "checkpoint.npz", None, resume)
        gauges = one.train(
            farm or Farm(), held or Farm(), lambda done, says: kept.append((one.meta["seconds"], done, says))
        )
        return one, method, gauges, kept

    return train


FIVE = [(10, 3, 0.1), (36, 5, 0.4), (4, 6, 0.5), (35, 7, 0.8), (35, 9, 1.0)]


def test_a_kill_loses_less_than_a_minute(made):
    """And what is measured at the end is measured on all that is held out."""
    one, _, gauges, kept = made(FIVE, held := Farm(), minutes=2.0)
    said = [line for line in kept if "held-out" not in line[2]]
    assert [seconds for seconds, *_ in said] == [0, 46, 46, 46, 120]
    assert [done for _, done, _ in said] == [0.1, 0.4, 0.5, 0.8, 1.0]
    assert said[0][2] == "3 steps, 7 somethings; x 0.5000"
    assert [line[1:] for line in kept if line not in said] == [(1.0, "held-out simulations: 1 of 2")]
    assert held.there == 2 and gauges.keys() == {HELD}
    assert one.meta["curve"] == [{"minutes": 0.77, "motion": 0.4}, {"minutes": 2.0, "motion": 0.4}]
    assert one.card()["steps"] == 9 and one.card()["minutes"] == 2.0


def test_the_first_gauge_is_measured_as_soon_as_that_can_be_done(made):
    *_, kept = made(FIVE[:3], Farm(2), minutes=2.0)
    assert [seconds for seconds, *_ in kept] == [10, 10, 10]


@pytest.mark.parametrize(
    ("budget", "began"), [({"minutes": 4.0}, (9, 0.5)), ({"steps": 12}, (9, 0.75)), ({"minutes": 1.5}, (9, 1.0))]
)
def test_a_run_goes_on_after_the_share_of_its_budget_that_it_has_used(made, budget, began):
    """Time between two runs does not count; one that has used all is measured and not trained further."""
    made(FIVE, minutes=2.0)
    one, method, gauges, kept = made([(30, 4, 1.0)], resume=True, **budget)
    assert method.began == began and gauges.keys() == {HELD}
    trained = began[1] < 1
    assert (one.meta["seconds"], one.meta["step"]) == ((150, 13) if trained else (120, 9))
    assert len(one.meta["curve"]) == 2 + trained and len(kept) == 1 + trained
    assert "resumed with other options" not in one.card()


def test_a_simulation_that_fails_ends_the_training(made):
    for others in ({"farm": Farm()}, {"held": Farm()}):
        (farm,) = others.values()
        farm.failed, farm.failure = lambda: True, lambda: NeuralocksError("warp: is broken")
        with pytest.raises(NeuralocksError, match="warp: is broken"):
            made(FIVE, minutes=2.0, **others)
