# SPDX-License-Identifier: Apache-2.0
"""Small budgets for the tests of whole trainings."""

import pytest


@pytest.fixture
def few(monkeypatch):
    """Trainings begin after four simulations, and are measured on two."""
    monkeypatch.setattr("neuralocks_core.training.methods.FIRST", 4)
    monkeypatch.setattr("neuralocks_core.training.train.HELD_OUT", 2)
