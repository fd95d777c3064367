# SPDX-License-Identifier: Apache-2.0
"""Muon: gradient descent whose steps have singular values of one, for the weight matrices of a network."""

from collections.abc import Iterable

import torch


def muon(net: torch.nn.Module, rate: float, decay: float) -> list[torch.optim.Optimizer]:
    """Muon for the matrices of a network, AdamW for the rest.

    Their steps are equally large, so one rate suits both.
    """
    matrices = [p for p in net.parameters() if p.ndim == 2]
    rest = [p for p in net.parameters() if p.ndim != 2]
    return [Muon(matrices, rate, decay), torch.optim.AdamW(rest, lr=rate, weight_decay=decay)]


class Muon(torch.optim.Optimizer):
    """Muon (Jordan et al. 2024) with steps as large as AdamW's (Liu et al. 2025, "Muon is Scalable", section 2.2).

    `torch.optim.Muon` is the same, but orthogonalises in bfloat16, which processors without instructions for it (most
    laptops) only imitate: 25 to 60 times slower there than in float32 (`benchmarks/optimiser.py`).

    Args:
        matrices: parameters of shape (rows, columns).
        lr: root mean square of a step's entries, divided by 0.2.
        weight_decay: share of a weight that is subtracted per step, divided by `lr`.
    """

    _MOMENTUM = 0.95
    # Size of the entries of AdamW's steps in practice, at rate 1.
    _RMS = 0.2

    def __init__(self, matrices: Iterable[torch.nn.Parameter], lr: float, weight_decay: float = 0.0) -> None:
        super().__init__(matrices, {"lr": lr, "weight_decay": weight_decay})

    @torch.no_grad()
    def step(self) -> None:
        """One step from the gradients that the parameters hold."""
        for group in self.param_groups:
            for matrix in group["params"]:
                if matrix.grad is not None:
                    self._move(matrix, group["lr"], group["weight_decay"])

    def _move(self, matrix: torch.nn.Parameter, rate: float, decay: float) -> None:
        state = self.state[matrix]
        if not state:
            state["momentum_buffer"] = torch.zeros_like(matrix)
        mean = state["momentum_buffer"].lerp_(matrix.grad, 1 - self._MOMENTUM)
        step = orthogonal(matrix.grad.lerp(mean, self._MOMENTUM))
        matrix.mul_(1 - rate * decay)
        matrix.add_(step, alpha=-self._RMS * rate * max(matrix.shape) ** 0.5)


def orthogonal(matrix: torch.Tensor) -> torch.Tensor:
    """A matrix with its singular vectors kept and its singular values moved near 1 (0.7 to 1.2).

    Five Newton-Schulz steps with Jordan's polynomial, which is steep at 0 instead of exact at 1: singular values below
    about a thousandth of the matrix' norm stay below that.

    Args:
        matrix: (rows, columns); zeros stay zeros.
    """
    tall = matrix.shape[0] > matrix.shape[1]
    x = matrix.T if tall else matrix
    x = x / x.norm().clamp(min=1e-7)
    for _ in range(5):
        square = x @ x.T
        x = torch.addmm(x, torch.addmm(square, square, square, beta=-4.7750, alpha=2.0315), x, beta=3.4445)
    return x.T if tall else x
