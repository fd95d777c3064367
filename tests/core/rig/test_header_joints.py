# SPDX-License-Identifier: Apache-2.0
"""What the header says of each joint: its name and what carries it, and harmless answers for a joint that is not there."""

import subprocess
from dataclasses import replace

from neuralocks_core.rig.export_c import export_c
from tests.core.rig.builders import branched, random_model
from tests.core.rig.c_programs import compiled

HARNESS = """#include "hair.h"
#include <limits.h>
#include <stdio.h>
int main(void) {
  const int far[2] = {INT_MIN, INT_MAX};
  int i;
  for (i = -1; i <= NL_HAIR_JOINTS; ++i) printf("%s %d\\n", nl_hair_joint_name(i), nl_hair_joint_parent(i));
  for (i = 0; i < 2; ++i) printf("%s %d\\n", nl_hair_joint_name(far[i]), nl_hair_joint_parent(far[i]));
  return 0;
}
"""


def test_the_header_names_each_joint_and_what_carries_it(tmp_path):
    chains = branched().chains
    export_c(replace(random_model((len(chains),)), chains=chains), tmp_path / "hair.h")
    program = compiled(tmp_path, HARNESS)
    lines = subprocess.run([program], capture_output=True, text=True, check=True).stdout.split("\n")
    wanted = [f"{name} {parent}" for name, parent in zip(chains.names, chains.parents, strict=True)]
    assert len(set(chains.parents)) > 3
    assert lines == [" -1", *wanted, " -1", " -1", " -1", ""]
