# SPDX-License-Identifier: Apache-2.0
"""Run every benchmark that needs nothing but this repository, one after the other: `make bench`."""

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
SCRIPTS = ("inference", "bake_speed", "bend_twist", "reference_speed", "rig_speed")


def main() -> int:
    """The worst exit status."""
    worst = 0
    for name in SCRIPTS:
        if (HERE / f"{name}.py").exists():
            print(f"\n== {name} ==", flush=True)
            worst = max(worst, subprocess.run([sys.executable, HERE / f"{name}.py"], cwd=HERE.parent).returncode)
    return worst


if __name__ == "__main__":
    sys.exit(main())
