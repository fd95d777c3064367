# SPDX-License-Identifier: Apache-2.0
"""Models of random weights, of either output, and strands for them."""

import numpy as np
import pytest

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.groom import Groom
from neuralocks_core.models import model_file
from neuralocks_core.strands.strand_set import strand_set

SPEC = BoundarySpec()


@pytest.fixture(scope="module")
def net():
    import torch  # here: modules that need it are skipped without it

    from neuralocks_core.training.autoencoder import StrandAutoencoder
    from neuralocks_core.training.networks import StrandNet

    torch.manual_seed(0)
    net, encoder = StrandNet(SPEC.size), StrandAutoencoder()
    with torch.no_grad():
        net.out.weight.mul_(20)
    return net, encoder


@pytest.fixture(scope="module", params=["direction", "displacement"])
def path(request, net, tmp_path_factory):
    from neuralocks_core.training.export import strand_graphs

    meta = {"kind": "strands", "boundary": SPEC.to_json(), "anchored": True, "output": request.param}
    file = tmp_path_factory.mktemp("model") / f"{request.param}.neuralocks"
    return model_file.write(file, meta, strand_graphs(net[1], net[0], request.param))


@pytest.fixture(scope="module")
def strands():
    rng = np.random.default_rng(0)
    normal = rng.normal(size=(5000, 3))
    normal[:, 1] = np.abs(normal[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    points = normal[:, None] * (0.09 + np.linspace(0, 0.3, 24)[None, :, None]) + rng.normal(size=(5000, 24, 3)) * 2e-3
    points[7] = points[7, :1]  # a strand without two distinct points
    groom = Groom("g", points.reshape(-1, 3).astype(np.float32), np.full(5000, 24), np.full(1, 1e-4, np.float32))
    return strand_set(groom, np.zeros(3), np.zeros(3))
