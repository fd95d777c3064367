# SPDX-License-Identifier: GPL-3.0-or-later
"""The model that live hair is tested with."""

import pytest

from tests.strand_models import write_random_model


@pytest.fixture(scope="session")
def random_model(tmp_path_factory):
    """Path of a strand model of random weights, whose hair moves a lot."""
    return write_random_model(tmp_path_factory.mktemp("model") / "random.neuralocks", gain=20.0)
