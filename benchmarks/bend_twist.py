# SPDX-License-Identifier: Apache-2.0
"""What the forms of the bend-twist potential cost, forward and backward, and what each gets right.

    python benchmarks/bend_twist.py [--strands 300 3000] [--threads 2] [--device cuda]

The paper gives 0.16 s for its fast transport, 0.98 s for the exact one and 0.14 s for Quaffure's. Times here are the
smallest of several rounds in which the forms take turns, so that their ratios are valid on a busy machine too. It takes
about a minute.
"""

from __future__ import annotations

import argparse
import math
import sys
import time

try:
    import torch
except ModuleNotFoundError:
    sys.exit('bend_twist: torch: is not installed; pip install ".[train]"')

from neuralocks_core.physics.bend_twist import Cosserat, bend_difference, bend_twist
from neuralocks_core.physics.gravity import gravity
from neuralocks_core.physics.rods import rods

NAMES = {
    Cosserat.DIRECT: "direct (the paper's)",
    Cosserat.SCAN: "exact, scan",
    Cosserat.LOOP: "exact, loop",
    Cosserat.CONSTANT: "constant director (Quaffure)",
}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strands", type=int, nargs="+", default=[300, 3000])
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--rounds", type=int, default=15)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    where = torch.cuda.get_device_name() if arguments.device.startswith("cuda") else f"{arguments.threads} threads"
    print(f"torch {torch.__version__}, {where}, 24 vertices a strand, float32, ms forward + backward\n")
    print("| form | " + " | ".join(f"{n} strands | ratio" for n in arguments.strands) + " |")
    print("|---" * (1 + 2 * len(arguments.strands)) + "|")
    table = [times(count, arguments.rounds, arguments.device) for count in arguments.strands]
    for form, name in NAMES.items():
        cells = [f"{1e3 * row[form]:.2f} | {row[form] / row[Cosserat.DIRECT]:.2f}" for row in table]
        print(f"| {name} | " + " | ".join(cells) + " |")
    print("\n| form | twist that is not there, 3 turns | 6 turns | largest gradient, folded | droop, straight | curl |")
    print("|---|---|---|---|---|---|")
    for form, name in NAMES.items():
        twist = ["-" if form is Cosserat.CONSTANT else f"{false_twist(form, turns):.3f}" for turns in (3, 6)]
        drops = " | ".join(f"{1e3 * droop(form, turns):.1f} mm" for turns in (0, 3))
        print(f"| {name} | {twist[0]} | {twist[1]} | {fold_gradient(form):.3g} | {drops} |")
    print(
        "\nTwist: part of the strain along the edge, of a curl measured from a straight strand; a strand whose tip is"
        "\nfree has none. Gradient: per mm, of a strand with one edge 0.01 rad from folding back, k = 1e-3 m^4/s^2."
        "\nDroop: of the tip of a strand that stands out 20 cm sideways, straight or in 3 turns, k = 1e-2."
    )


def times(strands: int, rounds: int, device: str) -> dict[Cosserat, float]:
    """Smallest seconds of one forward and backward pass by form."""
    generator = torch.Generator().manual_seed(0)
    rest = torch.randn(strands, 24, 3, generator=generator) * 0.004 + curl(3).float()
    x = (rest + torch.randn(rest.shape, generator=generator) * 0.002).to(device).requires_grad_()
    constants = rods(rest.to(device), supported=False)
    best = dict.fromkeys(NAMES, math.inf)
    for _ in range(rounds + 2):
        for form in NAMES:
            start = _now(device)
            bend_twist(x, constants, form=form).sum().backward()
            best[form] = min(best[form], _now(device) - start)
            x.grad = None
    return best


def curl(turns: float, length: float = 0.2) -> torch.Tensor:
    """(1, 24, 3) a hanging helix of 2 cm radius, float64."""
    t = torch.linspace(0, 1, 24, dtype=torch.float64)
    angle = 2 * math.pi * turns * t
    return torch.stack([0.02 * torch.cos(angle), -length * t, 0.02 * torch.sin(angle)], -1)[None]


def false_twist(form: Cosserat, turns: float) -> float:
    """Largest component of the strain along the edge, as l/2 Omega, for a curl that has none."""
    helix = curl(turns)
    edges = torch.nn.functional.normalize(helix.diff(dim=-2), dim=-1)
    straight = torch.arange(24, dtype=torch.float64)[:, None] * edges[:, :1]
    return float((bend_difference(helix, straight, form) * edges[:, :1]).sum(-1).abs().max())


def fold_gradient(form: Cosserat) -> float:
    """Largest gradient of the energy of a strand in which one edge points back along the root edge."""
    angle = torch.tensor([0.0, 0.9, 1.8, 2.6, math.pi - 0.01, 2.6, 1.8], dtype=torch.float64)
    edges = 0.01 * torch.stack([torch.sin(angle), -torch.cos(angle), 0 * angle], -1)
    x = torch.cat([torch.zeros(1, 3, dtype=torch.float64), edges.cumsum(0)])[None]
    x = (x + 1e-4 * torch.sin(torch.arange(24.0, dtype=torch.float64)).reshape(1, 8, 3)).requires_grad_()
    straight = torch.arange(8, dtype=torch.float64)[:, None] * torch.tensor([[0.0, -0.01, 0.0]])
    bend_twist(x, rods(straight[None], supported=False), form=form).sum().backward()
    return 1e-3 * float(x.grad.abs().max())


def droop(form: Cosserat, turns: float, steps: int = 5) -> float:
    """How far the tip of a strand that sticks out sideways hangs down in equilibrium [m]."""
    rest = curl(turns)[..., [1, 0, 2]] * torch.tensor([-1.0, 1.0, 1.0], dtype=torch.float64)
    constants = rods(rest, supported=False)
    edges = rest.diff(dim=-2)
    turn = torch.zeros(1, 22, 3, dtype=torch.float64, requires_grad=True)
    down = torch.tensor([0.0, -9.81, 0.0], dtype=torch.float64)

    def points() -> torch.Tensor:
        turned = torch.nn.functional.normalize(edges[:, 1:] / constants.length[:, 1:, None] + turn, dim=-1)
        moved = torch.cumsum(turned * constants.length[:, 1:, None], -2)
        return torch.cat([rest[:, :2], rest[:, 1:2] + moved], -2)

    # The weight grows in steps: in one step, the search may end with the curl wound differently.
    for part in range(1, steps + 1):
        # A new optimiser, since its memory is of other weights; torch's default tolerances stop it before the equilibrium.
        optimiser = torch.optim.LBFGS(
            [turn],
            max_iter=4000,
            max_eval=8000,
            history_size=50,
            tolerance_grad=1e-9,
            tolerance_change=1e-14,
            line_search_fn="strong_wolfe",
        )

        def closure(part=part, optimiser=optimiser) -> torch.Tensor:
            optimiser.zero_grad()
            x = points()
            energy = (bend_twist(x, constants, 1e-2, form) + gravity(x, constants, down * part / steps)).sum()
            (1e3 * energy).backward()
            return 1e3 * energy

        optimiser.step(closure)
    return float((rest - points()).detach()[0, -1, 1])


def _now(device: str) -> float:
    if device.startswith("cuda"):
        torch.cuda.synchronize()
    return time.perf_counter()


if __name__ == "__main__":
    main()
