# SPDX-License-Identifier: Apache-2.0
"""The losses of a regression on rollouts."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs torch")

from neuralocks_core.network_sizes import STRAND, K
from neuralocks_core.training.regression_losses import regression_losses
from neuralocks_core.training.regression_options import RegressionOptions

EDGE, KINK = 0.01, 0.6


class Still:
    """A network that leaves hair at rest."""

    def strand_part(self, strands):
        return strands

    def frame_part(self, frames):
        return frames

    def tail(self, strands, frames):
        count = len(frames), frames.shape[1], strands.shape[2]
        return torch.zeros(*count, 3 * K)


def hanging_and_kinked():
    """A straight strand, and the same bent by KINK [rad] at its middle vertex."""
    edges = np.tile([0.0, -EDGE, 0.0], (K - 1, 1))
    bent = edges.copy()
    bent[K // 2 :] = EDGE * np.array([np.sin(KINK), -np.cos(KINK), 0.0])
    return (np.concatenate([np.zeros((1, 3)), each.cumsum(axis=0)]) for each in (edges, bent))


def test_bending_is_the_turn_from_edge_to_edge_that_is_missing():
    """|e' - e| of two edges at an angle is twice the sine of half the angle, in edge lengths."""
    straight, bent = hanging_and_kinked()
    moved = torch.tensor(bent - straight, dtype=torch.float32).expand(1, 2, 1, K, 3)
    batch = {
        "strands": torch.zeros(1, 1, STRAND),
        "rest": torch.tensor(straight, dtype=torch.float32).expand(1, 1, K, 3),
        "length": torch.full((1, 1), (K - 1) * EDGE),
        "frames": torch.zeros(1, 3, 5),
        "moved": moved,
        "planes": torch.tensor([0.0, 1.0, 0.0, -1000.0]).expand(1, 2, 1, K, 4),
    }
    losses = regression_losses(Still(), batch, RegressionOptions(bending=2.0))
    assert losses["bending"].item() == pytest.approx(2.0 * 2 * np.sin(KINK / 2) / (K - 2), rel=0.02)
    assert losses["collision"].item() == 0 and losses["velocity"].item() < 1e-2
    batch["moved"] = torch.zeros_like(moved)
    assert regression_losses(Still(), batch, RegressionOptions(bending=2.0))["bending"].item() < 1e-3
