# SPDX-License-Identifier: Apache-2.0
"""The strand autoencoder: a strand's rest shape in 32 numbers (paper section 3.2).

The MLPs of the paper work beside linear maps that start as the principal components of all strands. 32 components alone
keep a strand within a millimetre, which the MLPs alone do not reach in minutes.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models.network_sizes import CODE, SHAPE, K
from neuralocks_core.progress import Progress
from neuralocks_core.strands.strand_set import StrandSet, scalp_local
from neuralocks_core.training.descent import Schedule, descend

HIDDEN = 256
"""Width of the hidden layers."""


def train_autoencoder(
    shapes: np.ndarray,
    *,
    seconds: float = 35.0,
    steps: int | None = None,
    batch: int = 256,
    rate: float = 3e-4,
    seed: int = 0,
    principal: bool = True,
    progress: Progress | None = None,
) -> StrandAutoencoder:
    """Train on all strands of all grooms; returns the autoencoder with frozen weights.

    Only the encoder is used later; the decoder shows how accurate a code is (`StrandAutoencoder.errors`).

    Args:
        shapes: (n, 24, 3) strands in scalp-local, root-relative coordinates, metres.
        seconds: wall-clock budget.
        steps: number of steps instead of a time budget; makes the result reproducible.
        batch: strands per step.
        rate: Adam's first step size; it falls to 1 % along a cosine.
        seed: random seed of weights and batches.
        principal: start from principal components; else the paper's MLPs alone.
        progress: called with done, total, message.

    Raises:
        NeuralocksError: there are no strands, or they are not finite.
    """
    shapes = np.asarray(shapes, np.float32)
    if shapes.ndim != 3 or shapes.shape[1:] != (K, 3) or not len(shapes):
        raise NeuralocksError(f"strand shapes: {shapes.shape} is not (n > 0, {K}, 3); give resampled strands")
    if not np.isfinite(shapes).all():
        raise NeuralocksError("strand shapes: some vertices are not finite; clean the groom first")
    generator = torch.Generator().manual_seed(seed)
    data = torch.from_numpy(shapes.reshape(len(shapes), SHAPE))
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        model = StrandAutoencoder(principal=principal)
    model.set_normalisation(data)
    optimiser = torch.optim.Adam(model.parameters(), lr=rate)
    # A millimetre is a larger part of the shape of short hair than of long hair.
    weight = 1.0 / (data[:, -3:].square().sum(1) + 0.05**2)
    weight = weight / weight.mean()

    def losses(_: float) -> dict[str, Tensor]:
        pick = torch.randint(len(data), (min(batch, len(data)),), generator=generator)
        target = data[pick]
        return {"shape": ((model(target) - target).square().mean(1) * weight[pick]).mean()}

    schedule = Schedule(seconds / 60, steps, rate, floor=0.01, warm_up=1, clip=float("inf"))
    for state in descend([optimiser], losses, schedule, remedy="look for strands of absurd length"):
        if progress:
            error = 1e3 * state.losses["shape"] ** 0.5
            progress(int(1000 * state.done), 1000, f"strand codes: error {error:.1f} mm")
    return model.eval().requires_grad_(False)


class StrandAutoencoder(nn.Module):
    """72 numbers -> 256 -> 256 -> 32 and back, ReLU, beside a linear map each way; coordinates in metres.

    Args:
        principal: with the linear maps; else the paper's MLPs alone.
    """

    def __init__(self, *, principal: bool = True):
        super().__init__()
        self.encoder = _mlp(SHAPE, HIDDEN, CODE)
        self.decoder = _mlp(CODE, HIDDEN, SHAPE)
        self.into = nn.Linear(SHAPE, CODE, bias=False) if principal else None
        self.back = nn.Linear(CODE, SHAPE, bias=False) if principal else None
        self.register_buffer("mean", torch.zeros(SHAPE))
        self.register_buffer("scale", torch.ones(SHAPE))

    @torch.no_grad()
    def set_normalisation(self, shapes: Tensor) -> None:
        """Take mean of each coordinate, spread of each vertex in all three, and principal components from shapes (n, 72)."""
        self.mean.copy_(shapes.mean(0))
        spread = (shapes - self.mean).square().reshape(-1, K, 3).mean((0, 2)).sqrt()
        # Vertices near the root hardly vary: dividing by almost zero would amplify noise.
        spread = spread.clamp_min(max(float(spread.max()) * 0.1, 1e-4))
        self.scale.copy_((1.0 / spread).repeat_interleave(3))
        if self.into is None:
            return
        normal = ((shapes - self.mean) * self.scale).double()
        _, directions = torch.linalg.eigh(normal.T @ normal / len(normal))  # in ascending order
        kept = directions.flip(1)[:, : len(self.into.weight)].T.to(shapes.dtype)
        self.into.weight.copy_(kept)
        self.back.weight.copy_(kept.T)
        for mlp in (self.encoder, self.decoder):  # which start by adding nothing
            mlp[-1].weight.zero_()
            mlp[-1].bias.zero_()

    def encode(self, shapes: Tensor) -> Tensor:
        """(..., 72) scalp-local root-relative coordinates -> (..., 32) codes."""
        normal = (shapes - self.mean) * self.scale
        return self.encoder(normal) if self.into is None else self.encoder(normal) + self.into(normal)

    def forward(self, shapes: Tensor) -> Tensor:
        """(..., 72) -> (..., 72) reconstruction, metres."""
        codes = self.encode(shapes)
        normal = self.decoder(codes) if self.back is None else self.decoder(codes) + self.back(codes)
        return normal / self.scale + self.mean

    @torch.no_grad()
    def errors(self, shapes: np.ndarray) -> np.ndarray:
        """(n, 24, 3) strands -> (n, 24) distance between each vertex and its reconstruction, metres."""
        flat = torch.from_numpy(np.asarray(shapes, np.float32).reshape(len(shapes), SHAPE)).to(self.mean.device)
        return (self(flat) - flat).reshape(-1, K, 3).norm(dim=-1).cpu().numpy()

    @torch.no_grad()
    def codes(self, shapes: np.ndarray) -> np.ndarray:
        """(n, 24, 3) strands -> (n, 32) float32 codes."""
        flat = torch.from_numpy(np.asarray(shapes, np.float32).reshape(len(shapes), SHAPE)).to(self.mean.device)
        return self.encode(flat).cpu().numpy()

    def codes_of(self, strands: StrandSet) -> np.ndarray:
        """(S, 32) float32 codes of a groom's strands."""
        return self.codes(scalp_local(strands))


def _mlp(inputs: int, hidden: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(inputs, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU(), nn.Linear(hidden, outputs)
    )
