# SPDX-License-Identifier: Apache-2.0
"""Models of mesh hair of random weights, for tests of what runs them."""

import numpy as np

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.rig import HairChains, RigModel
from neuralocks_core.rig.network import feature_columns, input_limits


def random_rig_model(chains: HairChains, spec: BoundarySpec, hidden=16, seed=0, gain=1.0) -> RigModel:
    """A network for these chains without a trained meaning; `gain` is on the weights of each layer."""
    rng = np.random.default_rng(seed)
    size, layers = len(feature_columns(spec)), []
    for out in (hidden, hidden, 3 * len(chains)):
        layers.append((rng.normal(0, gain / np.sqrt(size), (out, size)), rng.normal(0, 0.1, out)))
        size = out
    return RigModel(chains, spec, tuple(layers), input_limits(spec))
