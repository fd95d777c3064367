# SPDX-License-Identifier: Apache-2.0
"""Small scenes and budgets for the tests of trainings."""

import pytest

from tests.core.rigs import person, straight_hair


@pytest.fixture(scope="module")
def scene():
    """One head with a little straight hair."""
    from neuralocks_core.training.rollouts import TrainingScene  # needs torch: modules without it are skipped

    return TrainingScene(person(), (straight_hair(),), frames=60, strands=24)


@pytest.fixture
def few(monkeypatch):
    """Trainings begin after four simulations, and are measured on two."""
    monkeypatch.setattr("neuralocks_core.training.methods.FIRST", 4)
    monkeypatch.setattr("neuralocks_core.training.train.HELD_OUT", 2)
