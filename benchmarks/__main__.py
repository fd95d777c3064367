# SPDX-License-Identifier: Apache-2.0
"""Run the benchmarks of speed that need no Blender, one after another: `make bench`."""

import argparse
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
SCRIPTS = ("inference", "bake_speed", "bend_twist", "resolve", "reference_speed", "rig_speed", "optimiser")


def main() -> int:
    """The worst exit status."""
    argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__, epilog=", ".join(SCRIPTS)).parse_args()
    worst = 0
    for name in SCRIPTS:
        print(f"\n== {name} ==", flush=True)
        worst = max(worst, subprocess.run([sys.executable, HERE / f"{name}.py"], cwd=HERE.parent).returncode)
    return worst


if __name__ == "__main__":
    sys.exit(main())
