# SPDX-License-Identifier: Apache-2.0
"""Strands that several tests bend."""

import pytest
import torch


@pytest.fixture
def curls():
    """Four curly strands of 12 vertices, float64."""
    t = torch.linspace(0, 1, 12, dtype=torch.float64)
    shift = torch.arange(4.0, dtype=torch.float64)[:, None]
    helix = [0.02 * torch.cos(9 * t + shift), -0.2 * t + 0 * shift, 0.02 * torch.sin(9 * t + shift) + 0.004 * shift]
    return torch.stack(helix, -1)
