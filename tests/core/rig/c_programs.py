# SPDX-License-Identifier: Apache-2.0
"""Programs round an exported header, built by every compiler that there is and fed with float32 rows."""

import shutil
import subprocess
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

FLAGS = ["-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror", "-pedantic"]
COMPILERS = [("gcc", "c", "c99"), ("g++", "c++", "c++11"), ("clang", "c", "c99"), ("clang++", "c++", "c++11")]
INPUT_HARNESS = """#include "hair.h"
#include <stdio.h>
int main(void) {
  static nl_hair_input in;
  static float x[NL_HAIR_FEATURES];
  while (fread(&in, sizeof in, 1, stdin) == 1) {
    nl_hair_features(&in, x);
    fwrite(x, sizeof x, 1, stdout);
  }
  return 0;
}
"""
"""Gives the features of each input."""
HISTORY_HARNESS = """#include "hair.h"
#include <stdio.h>
int main(void) {
  static nl_hair_history history;
  static float row[8], out[6 * NL_HAIR_BINS];
  const float down[3] = {0.0f, -1.0f, 0.0f};
  nl_hair_history_reset(&history);
  while (fread(row, sizeof row, 1, stdin) == 1) {
    nl_hair_history_push(&history, (double)row[0], row + 1, row + 4);
    nl_hair_history_read(&history, down, out);
    fwrite(out, sizeof out, 1, stdout);
  }
  return 0;
}
"""
"""Pushes and reads a history at each row: time [s], position, rotation."""


def compiled(folder, source, options=("-O2",), compiler=("gcc", "c", "c99")):
    """Build a program beside the header; skips where there is no such compiler."""
    if shutil.which(compiler[0]) is None:
        pytest.skip(f"no {compiler[0]} to compile the header with")
    headers = {path.name: path.read_bytes() for path in folder.glob("*.h*")}
    program = folder / "main"
    program.write_bytes(_built(tuple(sorted(headers.items())), source, tuple(options), compiler))
    program.chmod(0o755)
    return program


@cache  # most tests ask for a program that another has asked for
def _built(headers, source, options, compiler) -> bytes:
    """A program of a source and of the headers, (name, bytes) each, that lie beside it."""
    name, lang, std = compiler
    own = ["-Wcomma"] if "clang" in name else []
    command = [name, "-x", lang, f"-std={std}", *FLAGS, *own, *options, "main.src", "-lm", "-o", "main"]
    with TemporaryDirectory() as folder:
        for file, text in (*headers, ("main.src", source.encode())):
            (Path(folder) / file).write_bytes(text)
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return (Path(folder) / "main").read_bytes()


def run_c(program, inputs, width):
    """Feed float32 rows, read float32 rows."""
    done = subprocess.run([program], input=np.asarray(inputs, "<f4").tobytes(), capture_output=True, check=True)
    return np.frombuffer(done.stdout, "<f4").reshape(-1, width)
