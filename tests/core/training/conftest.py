# SPDX-License-Identifier: Apache-2.0
"""Small scenes and budgets for the tests of trainings."""

from pathlib import Path

import pytest

from tests.core.rigs import person, straight_hair


@pytest.fixture(scope="module")
def scene():
    """One head with a little straight hair."""
    from neuralocks_core.training.data.rollouts import TrainingScene  # needs torch: modules without it are skipped

    return TrainingScene(person(), (straight_hair(),), frames=60, strands=24)


@pytest.fixture
def few(monkeypatch):
    """Trainings begin after four simulations, and are measured on two."""
    monkeypatch.setattr("neuralocks_core.training.learning.methods.FIRST", 4)
    monkeypatch.setattr("neuralocks_core.training.train.HELD_OUT", 2)


@pytest.fixture
def in_one_process(monkeypatch):
    """Trainings make their simulations themselves: each process of a farm would import warp first, which takes seconds, and a
    training has two.
    """
    monkeypatch.setattr("neuralocks_core.training.train.RolloutFarm", _Farm)
    monkeypatch.setattr("neuralocks_core.training.learning.methods.LOOK_AGAIN", 0.0)


class _Farm:
    """Stands in for a slow farm: whenever files are looked for of which some are not there yet, one more is."""

    alive = True

    def __init__(self, scene, folder: Path, count: int, _processes: int = 1):
        self.count, self._scene, self._maker = count, scene, None
        self._paths = [folder / f"{index:06d}.npz" for index in range(count)]
        folder.mkdir(parents=True, exist_ok=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def files(self, first=None):
        asked = self._paths[:first]
        if missing := [path for path in asked if not path.exists()]:
            self._make(missing[0])
        return [path for path in asked if path.exists()]

    def failed(self):
        return False

    def _make(self, path: Path) -> None:
        from neuralocks_core.training.data.farm import save
        from neuralocks_core.training.data.rollouts import RolloutMaker

        self._maker = self._maker or RolloutMaker(self._scene)
        save(path, self._maker.make(int(path.stem)))
