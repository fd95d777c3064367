# SPDX-License-Identifier: Apache-2.0
"""The header where a compiler was told that there is no NaN: game engines build with fast mathematics, debug builds, too."""

import numpy as np
import pytest

from neuralocks_core.rig import rig_spec
from neuralocks_core.rig.export_c import export_c
from tests.core.rig.builders import random_model
from tests.core.rig.c_programs import COMPILERS, compiled, run_c

HARNESS = """#include "hair.h"
#include <stdio.h>
int main(void) {
  static nl_hair_history history;
  static nl_hair_input in;
  static nl_hair_output out;
  const float place[3] = {0.0f, 1.6f, 0.0f};
  double time = 0.0;
  nl_hair_history_reset(&history);
  while (fread(&in, 15 * sizeof(float), 1, stdin) == 1) {
    nl_hair_history_push(&history, time += 0.02, place, in.head);
    nl_hair_history_read(&history, in.down, in.history);
    nl_hair_evaluate(&in, &out);
    fwrite(in.history, sizeof in.history, 1, stdout);
    fwrite(&out, sizeof out, 1, stdout);
  }
  return 0;
}
"""


@pytest.mark.parametrize("compiler", [COMPILERS[0], COMPILERS[2]], ids=lambda c: c[0])
@pytest.mark.parametrize("optimised", ["-O0", "-O3"])
def test_any_finite_input_gives_a_turn(tmp_path, compiler, optimised):
    """Turning a gravity of 3e38 would overflow to infinity, and the difference of two to NaN, which no comparison finds then."""
    spec = rig_spec(True)
    model = random_model(spec=spec)
    export_c(model, tmp_path / "hair.h")
    rng = np.random.default_rng(0)
    sizes = [0, 1e-42, 1e-38, 1, 1e10, 1e30, 3.4e38]
    wild = rng.choice(sizes, (500, 15)) * rng.uniform(-1, 1, (500, 15))
    program = compiled(tmp_path, HARNESS, (optimised, "-ffast-math"), compiler)
    history, turns = np.split(run_c(program, wild, 6 * len(spec.bins) + 64), [6 * len(spec.bins)], axis=1)
    felt, spun = np.moveaxis(history.reshape(len(wild), -1, 2, 3), 2, 0)
    for values, most in ((felt, 6), (spun, 25)):
        assert np.linalg.norm(values, axis=-1).max() < 1.001 * most
    turns = turns.reshape(len(wild), -1, 4)
    np.testing.assert_allclose(np.linalg.norm(turns, axis=-1), 1, atol=1e-5)
    assert turns[..., 0].min() > np.cos(model.max_angle / 2) - 1e-5
