# SPDX-License-Identifier: Apache-2.0
"""Models for bakes in tests: random weights, strong enough to move hair by centimetres."""

import pytest

from tests.strand_models import write_random_model


@pytest.fixture(scope="session")
def model(tmp_path_factory):
    """Path of a random model."""
    return write_random_model(tmp_path_factory.mktemp("model") / "random.neuralocks", gain=4.0)


@pytest.fixture(scope="session")
def still_model(tmp_path_factory):
    """Path of a model that never moves hair relative to the head."""
    return write_random_model(tmp_path_factory.mktemp("model") / "still.neuralocks", gain=0.0)
