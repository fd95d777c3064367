# SPDX-License-Identifier: Apache-2.0
"""Compile the C files here for every platform: `make native`, with the package ziglang.

Its compiler makes libraries for all of them on any one, and the same bytes from the same source.
"""

import hashlib
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

from neuralocks_core.native.library import FOLDER, file_for

TARGETS = {
    "linux-x64": "x86_64-linux-gnu.2.17",
    "linux-arm64": "aarch64-linux-gnu.2.17",
    "windows-x64": "x86_64-windows-gnu",
    "macos-arm64": "aarch64-macos.11.0",
    "macos-x64": "x86_64-macos.11.0",
}
"""Zig's name of each system that the packages we depend on support."""
SOURCES = sorted(file for ending in "ch" for file in FOLDER.parent.glob(f"*.{ending}"))
MADE = FOLDER / "made_from.txt"
# Products and sums are not contracted: that would round differently from numpy.
FLAGS = "-std=c99 -O2 -ffp-contract=off -fno-math-errno -fvisibility=hidden -fPIC -shared -s -nostdlib -Wall -Wextra -Werror -pedantic".split()


def main() -> None:
    """Build all."""
    for target in TARGETS:
        print(build(target, file_for(target)))
    MADE.write_text(made(), encoding="utf-8")


def made() -> str:
    """What the libraries depend on: compiler and sources. Kept beside them, to tell when they are out of date."""
    digests = [f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.name}" for file in SOURCES]
    return "\n".join([f"ziglang {version('ziglang')}", " ".join(FLAGS), *digests, ""])


def build(target: str, out: Path) -> Path:
    """Compile for one target into this file."""
    out.parent.mkdir(parents=True, exist_ok=True)
    sources = [file.name for file in SOURCES if file.suffix == ".c"]  # without a folder, which would be in the library
    named = [f"-Wl,-install_name,@rpath/{out.name}"] if target.startswith("macos") else []  # as would that of `out`
    compiler = [sys.executable, "-m", "ziglang", "cc", "-target", TARGETS[target]]
    subprocess.run([*compiler, *FLAGS, *named, *sources, "-o", str(out)], cwd=FOLDER.parent, check=True)
    out.chmod(0o644)
    for linkers in out.parent.glob("*.lib"):  # comes with a library for Windows
        linkers.unlink()
    return out


if __name__ == "__main__":
    main()
