# SPDX-License-Identifier: Apache-2.0
"""The losses of a regression on rollouts."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs torch")

from neuralocks_core.materials import MARGIN
from neuralocks_core.models.network_sizes import STRAND, K
from neuralocks_core.training.learning.regression_losses import CREEP, STILL, TOGETHER, regression_losses
from neuralocks_core.training.learning.regression_options import RegressionOptions

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


class Answering(Still):
    """A network of displacements that gives the same answer whatever it reads, and none for the bind pose, which comes last."""

    def __init__(self, moved):
        self._offsets = torch.cat([moved, torch.zeros_like(moved[:, :1])], 1).flatten(-2)

    def tail(self, strands, frames):
        return self._offsets


LENGTH = 0.2


def swinging():
    """Displacements (1, 4, 3, 24, 3) of three strands in two pairs of frames: far, each its own way; the root is clamped."""
    moved = 0.05 * torch.randn(1, 4, 3, K, 3, generator=torch.Generator().manual_seed(0))
    moved[..., :2, :] = 0
    return moved


def losses(answer, moved, planes=(0.0, 1.0, 0.0, -1000.0), **weights):
    """Losses, of weight 1 each if none is given."""
    options = RegressionOptions(output="displacement", **{**dict.fromkeys(WEIGHTS, 1.0), **weights})
    batch = {
        "strands": torch.zeros(1, 3, STRAND),
        "rest": torch.zeros(1, 3, K, 3),
        "length": torch.full((1, 3), LENGTH),
        "frames": torch.zeros(1, 5, 5),
        "moved": moved,
        "planes": torch.tensor(planes).expand(1, 4, 3, K, 4),
    }
    return {name: value.item() for name, value in regression_losses(Answering(answer), batch, options).items()}


WEIGHTS = ("position", "velocity", "swing", "settling", "parting", "bending", "collision")


def test_half_the_motion_has_half_of_each_error():
    moved = swinging()
    right, half, none = (losses(share * moved, moved) for share in (1.0, 0.5, 0.0))
    assert max(right.values()) < 2e-2  # all are smooth at zero
    off, steps = (each.norm(dim=-1).mean().item() / LENGTH for each in (moved, moved[:, 1::2] - moved[:, ::2]))
    assert none["position"] == pytest.approx(off, rel=0.01) and none["velocity"] == pytest.approx(steps, rel=0.01)
    for name in ("swing", "settling", "parting"):
        assert none[name] == pytest.approx(1, abs=0.03), name
    for name in WEIGHTS[:-1]:
        assert half[name] == pytest.approx(0.5 * none[name], rel=0.02), name


def test_each_loss_counts_by_its_own_weight():
    moved, weights = swinging(), {name: 2.0 + i for i, name in enumerate(WEIGHTS)}
    plain, weighed = (losses(0.5 * moved, moved, (0.0, 1.0, 0.0, 0.01), **each) for each in ({}, weights))
    assert min(plain.values()) > 1e-3
    assert weighed == pytest.approx({name: weights[name] * plain[name] for name in WEIGHTS})


def test_what_hardly_moves_or_parts_is_measured_by_its_length():
    """The solver's hair stands still in one lock, the answer does not."""
    answer = 0.1 * swinging()
    found = losses(answer, 0 * answer)
    about = (answer - answer.mean(1, keepdim=True)).square().sum(-1).mean((1, 3)).sqrt().mean().item()
    steps = (answer[:, 1::2] - answer[:, ::2]).square().sum(-1).mean(-1).sqrt().mean().item()
    apart = (answer - answer.mean(2, keepdim=True)).square().sum(-1).mean().sqrt().item()
    for name, far, least in (("swing", about, STILL), ("settling", steps, CREEP), ("parting", apart, TOGETHER)):
        assert found[name] == pytest.approx(far / (least * LENGTH), rel=1e-3), name


def test_each_ratio_leaves_out_what_the_others_measure():
    """Hair that hangs elsewhere swings rightly; a lock that moves as one in the wrong way parts rightly; and both may come to rest."""
    moved = swinging()
    elsewhere = 0.05 * torch.randn(3, K, 3, generator=torch.Generator().manual_seed(1))
    elsewhere[:, :2] = 0
    droop = losses(moved + elsewhere, moved)
    assert droop["position"] > 0.2 and max(droop[name] for name in ("velocity", "swing", "settling")) < 0.01
    together = losses(moved + 0.1 * moved[:, :, :1].roll(1, 1), moved)
    assert together["parting"] < 0.01 and min(together[name] for name in ("velocity", "swing", "settling")) > 0.05
    pairs = torch.tensor([1.0, 1.0, -1.0, -1.0])[:, None, None, None]
    slow = losses(moved + 0.05 * elsewhere * pairs, moved)
    assert max(slow["velocity"], slow["settling"]) < 0.01 < 0.03 < slow["swing"]


@pytest.mark.parametrize(
    "up, depth",
    [(0.02, 0.01 + MARGIN), (0.012, 0.012), (0.005, 0.005), (0.0, 0.0)],
    ids=["clear", "near", "deep", "as"],
)
def test_hair_is_pushed_as_far_out_of_the_body_as_the_solvers_is_and_no_farther_than_the_margin(up, depth):
    """The answer stays at rest, which is 1 cm below the plane; what goes along the plane goes no deeper."""
    across, along = torch.tensor([0.0, 0.8, 0.6]), torch.tensor([0.1, -0.3, 0.4])
    moved = (up * across + along).expand(1, 4, 3, K, 3).clone()
    found = losses(0 * moved + along, moved, (*across.tolist(), 0.01))
    assert found["collision"] == pytest.approx(depth / LENGTH, abs=1e-6)
