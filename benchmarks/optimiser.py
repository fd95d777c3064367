# SPDX-License-Identifier: Apache-2.0
"""What a step of Muon costs: ours in float32, and torch's own, which orthogonalises in bfloat16.

    python benchmarks/optimiser.py [--threads 1]

The shapes are matrices of the shipped networks. Times are the smallest of several rounds in which both take turns.
"""

import argparse
import time

import plain_errors  # noqa: F401
import torch

from neuralocks_core.training.muon import Muon

SHAPES = (256, 256), (256, 480), (256, 100), (16, 16)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=15)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    print(f"torch {torch.__version__}, {arguments.threads} threads, ms a step\n")
    print("| matrix | float32 (ours) | bfloat16 (torch's) | torch's / ours |\n| --- | --- | --- | --- |")
    for shape in SHAPES:
        optimisers = [_optimiser(shape, Muon), _optimiser(shape, _torchs)]
        rounds = [[_seconds(optimiser) for optimiser in optimisers] for _ in range(arguments.rounds)]
        ours, theirs = (1e3 * min(times) for times in zip(*rounds, strict=True))
        print(f"| {shape[0]} x {shape[1]} | {ours:.2f} | {theirs:.2f} | {theirs / ours:.1f} |")


def _torchs(parameters: list[torch.nn.Parameter], lr: float) -> torch.optim.Optimizer:
    return torch.optim.Muon(parameters, lr, weight_decay=0.0, adjust_lr_fn="match_rms_adamw")


def _optimiser(shape: tuple[int, int], kind) -> torch.optim.Optimizer:
    weights = torch.nn.Parameter(torch.randn(shape))
    weights.grad = torch.randn(shape)
    return kind([weights], lr=1e-3)


def _seconds(optimiser: torch.optim.Optimizer, steps: int = 5) -> float:
    start = time.perf_counter()
    for _ in range(steps):
        optimiser.step()
    return (time.perf_counter() - start) / steps


if __name__ == "__main__":
    main()
