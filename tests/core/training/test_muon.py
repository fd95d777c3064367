# SPDX-License-Identifier: Apache-2.0
"""Muon in float32: what a step is made of, beside torch's own in bfloat16."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from neuralocks_core.training.muon import Muon, muon, orthogonal  # noqa: E402


@pytest.mark.parametrize("shape", [(40, 40), (24, 72), (72, 24)])
def test_singular_vectors_stay_and_their_lengths_become_one(shape):
    """A matrix made of known singular vectors, with lengths from 1 to 10."""
    draw = torch.Generator().manual_seed(1)
    few = min(shape)
    left = torch.linalg.qr(torch.randn(shape[0], few, generator=draw))[0]
    right = torch.linalg.qr(torch.randn(shape[1], few, generator=draw))[0]
    matrix = left @ torch.diag(torch.linspace(1, 10, few)) @ right.T
    lengths = left.T @ orthogonal(matrix) @ right
    diagonal = torch.diagonal(lengths)
    assert 0.65 < diagonal.min() and diagonal.max() < 1.25
    np.testing.assert_allclose(lengths - torch.diag(diagonal), 0, atol=1e-4)


def test_a_gradient_of_zeros_moves_nothing():
    """No division by its norm."""
    weights = torch.nn.Parameter(torch.ones(3, 5))
    weights.grad = torch.zeros(3, 5)
    Muon([weights], 0.1).step()
    np.testing.assert_array_equal(weights.detach(), 1)


def test_it_goes_where_torchs_own_goes():
    """Five steps with momentum and decay; torch's are of 8 bits."""
    draw = torch.Generator().manual_seed(2)
    start = torch.randn(30, 50, generator=draw)
    ours, theirs = torch.nn.Parameter(start.clone()), torch.nn.Parameter(start.clone())
    options = {"lr": 0.05, "weight_decay": 0.1}
    optimisers = Muon([ours], **options), torch.optim.Muon([theirs], adjust_lr_fn="match_rms_adamw", **options)
    for _ in range(5):
        ours.grad = torch.randn(30, 50, generator=draw)
        theirs.grad = ours.grad.clone()
        for optimiser in optimisers:
            optimiser.step()
    way = (ours - start).norm()
    assert way > 1 and (ours - theirs).norm() < 0.02 * way


def test_matrices_and_the_rest_are_parted():
    """Biases have no singular values."""
    net = torch.nn.Sequential(torch.nn.Linear(3, 5), torch.nn.Linear(5, 2))
    matrices, rest = ([tuple(p.shape) for group in o.param_groups for p in group["params"]] for o in muon(net, 1e-3, 0))
    assert matrices == [(5, 3), (2, 5)] and rest == [(5,), (2,)]
