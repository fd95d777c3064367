# SPDX-License-Identifier: Apache-2.0
"""Models for bakes in tests: random weights, strong enough to move hair by centimetres."""

import pytest

from neuralocks_core import model as model_file
from neuralocks_core.boundary import BoundarySpec


@pytest.fixture(scope="session")
def model(tmp_path_factory):
    """Path of a random model."""
    return _random_model(tmp_path_factory.mktemp("model") / "random.neuralocks", gain=4.0)


@pytest.fixture(scope="session")
def still_model(tmp_path_factory):
    """Path of a model that never moves hair against the head."""
    return _random_model(tmp_path_factory.mktemp("model") / "still.neuralocks", gain=0.0)


def _random_model(path, gain):
    torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")
    from neuralocks_core.training.autoencoder import StrandAutoencoder
    from neuralocks_core.training.export import strand_graphs
    from neuralocks_core.training.networks import StrandNet

    torch.manual_seed(0)
    spec = BoundarySpec()
    net, encoder = StrandNet(spec.size), StrandAutoencoder()
    with torch.no_grad():
        net.out.weight.mul_(gain)
        net.out.bias.mul_(gain)
    meta = {"kind": "strands", "boundary": spec.to_json(), "anchored": True, "output": "direction"}
    return model_file.write(path, meta, strand_graphs(encoder, net, "direction"))
