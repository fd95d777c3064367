# SPDX-License-Identifier: Apache-2.0
"""How models got better while they trained, drawn from their cards.

    python benchmarks/training_curves.py MODEL [MODEL ...] -o docs/training.png

Motion error (1: hair carried rigidly) and position error of the gauge, on strands and motion that training never saw.
Also prints a table of them at a few times.
"""

from __future__ import annotations

import argparse

import numpy as np
import plain_errors  # noqa: F401

from neuralocks_core.models import model_file

SHOWN = {"motion": "motion error (rigid = 1)", "position": "position error [% of strand length]"}


def main() -> None:
    """Command line."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="+")
    parser.add_argument("-o", "--out", required=True)
    arguments = parser.parse_args()
    figure, axes = pyplot.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
    print("| minutes | of | motion error | position | droop |\n| ---: | ---: | ---: | ---: | ---: |")
    for path in arguments.models:
        training = model_file.read(path, "strands").meta["training"]
        rows = training["curve"]
        minutes = np.array([row["minutes"] for row in rows])
        for axis, (name, label) in zip(axes, SHOWN.items()):
            axis.plot(minutes, [row[name] for row in rows], label=f"{minutes[-1]:.0f} minutes")
            axis.set(xlabel="minutes", ylabel=label)
            axis.grid(alpha=0.3)
        for share in (0.1, 0.25, 0.5, 0.75, 1.0):
            row = rows[int(np.abs(minutes - share * minutes[-1]).argmin())]
            cells = f"{row['minutes']:.1f} | {minutes[-1]:.0f} | {row['motion']:.2f} | {row['position']:.1f} | {row['droop']:.2f}"
            print(f"| {cells} |")
    axes[0].legend(frameon=False)
    figure.savefig(arguments.out, dpi=110)


if __name__ == "__main__":
    main()
