# SPDX-License-Identifier: Apache-2.0
"""What a regression on rollouts punishes."""

import numpy as np
import pytest

from tests.core.rigs import person, straight_hair

torch = pytest.importorskip("torch", reason="training needs torch")

from neuralocks_core.network_sizes import CODE, STRAND, K
from neuralocks_core.training.regression import RolloutBank
from neuralocks_core.training.regression_losses import regression_losses
from neuralocks_core.training.regression_options import RegressionOptions
from neuralocks_core.training.rollouts import STEP, Rollout, TrainingScene

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


def batch_of(rest, moved, pairs=()):
    """A batch of a single strand in so many rollouts, two moments in each, without a body."""
    count = len(moved)
    return {
        "strands": torch.zeros(count, 1, STRAND),
        "rest": torch.tensor(rest, dtype=torch.float32).expand(count, 1, K, 3),
        "length": torch.full((count, 1), (K - 1) * EDGE),
        "frames": torch.zeros(count, 3, 5),
        "moved": torch.tensor(np.array(moved), dtype=torch.float32)[:, None, None].expand(count, 2, 1, K, 3),
        "planes": torch.tensor([0.0, 1.0, 0.0, -1000.0]).expand(count, 2, 1, K, 4),
        "pairs": torch.tensor(pairs, dtype=torch.int64).reshape(-1, 2),
    }


def test_bending_is_the_turn_from_edge_to_edge_that_is_missing():
    """|e' - e| of two edges that a turn by an angle parts is twice the sine of its half, in edge lengths."""
    straight, bent = hanging_and_kinked()
    losses = regression_losses(Still(), batch_of(straight, [bent - straight]), RegressionOptions(bending=2.0))
    assert losses["bending"].item() == pytest.approx(2.0 * 2 * np.sin(KINK / 2) / (K - 2), rel=0.02)
    assert losses["collision"].item() == 0 and losses["velocity"].item() < 1e-2
    at_rest = batch_of(straight, [0 * straight])
    assert regression_losses(Still(), at_rest, RegressionOptions(bending=2.0))["bending"].item() < 1e-3


def test_response_is_the_difference_between_two_materials_that_is_missing():
    """Whatever both have in common is not its matter; without pairs there is none."""
    straight, bent = hanging_and_kinked()
    turned, options = bent - straight, RegressionOptions(response=2.0)
    missing = batch_of(straight, [turned, 0 * turned, turned], [(0, 1)])
    assert regression_losses(Still(), missing, options)["response"].item() == pytest.approx(2.0, rel=0.01)
    common = batch_of(straight, [turned, 0 * turned, turned], [(0, 2)])
    assert regression_losses(Still(), common, options)["response"].item() < 0.01
    assert regression_losses(Still(), batch_of(straight, [turned]), options)["response"].item() == 0


def test_a_batch_tells_which_of_its_rollouts_are_the_same_in_two_materials():
    """Both show the same strands at the same moments, each with the material that it was simulated in."""
    rng = np.random.default_rng(0)
    scene = TrainingScene(person(), (straight_hair(),), frames=12, strands=8)
    bank = RolloutBank(scene, lambda strands: np.zeros((len(strands.rest), CODE), np.float32))
    for twice in (True, False):
        chosen = np.tile(np.arange(4), 2) if twice else np.arange(8)
        materials = np.repeat(rng.normal(size=(4, 4)), 2, axis=0).astype(np.float32)  # locks of two
        bank.rollouts.append(
            Rollout(
                groom=0,
                strands=chosen,
                rest=scene.grooms[0].rest[chosen].astype(np.float32),
                first=1,
                vectors=np.tile(np.arange(12, dtype=np.float32)[:, None], (1, scene.spec.size)),
                bind=np.zeros(scene.spec.size, np.float32),
                # Which of the strands a row shows, and in which material, can be read off what it has moved by.
                moved=np.broadcast_to(np.arange(8, dtype=np.int16)[None, :, None, None], (12, 8, K, 3)).copy(),
                planes=np.zeros((12, 8, K, 4), np.float16),
                residual=0.0,
                materials=materials,
            )
        )
    assert [rollout.paired for rollout in bank.rollouts] == [True, False]
    batch = bank.batch(rng, RegressionOptions(clips=31, moments=2, strands=3))
    assert len(batch["frames"]) == 31 and 0 < len(batch["pairs"]) <= 15
    row = (batch["moved"][:, 0, :, 0, 0] / STEP).round().long()
    material = batch["frames"][:, 0, scene.spec.slices["material"]]
    for one, other in batch["pairs"]:
        assert torch.equal((row[one] + 4) % 8, row[other])
        assert torch.equal(batch["rest"][one], batch["rest"][other])
        assert torch.equal(batch["frames"][one][:, -1], batch["frames"][other][:, -1])
        for each in (one, other):
            assert np.array_equal(material[each], bank.rollouts[0].materials[row[each][0]])
            assert (bank.rollouts[0].materials[row[each]] == material[each].numpy()).all()
