# SPDX-License-Identifier: Apache-2.0
"""The exported header in a small engine that reads a stage with USD alone, compared with a bake of the same shot."""

import subprocess

import numpy as np
import pytest
from pxr import Usd, UsdSkel
from scipy.spatial.transform import Rotation

from neuralocks_core.rig import RigModel
from neuralocks_core.rig.export_c import export_c
from usd.rig.bake import bake_rig

from ...core.rig.c_programs import compiled
from ..rig_shots import EXAMPLE

ENGINE = """#include "hair.h"
#include <stdio.h>
int main(void) {
  static double row[16];
  static nl_hair_output out;
  static nl_hair_input in;
  int i;
#ifdef NL_HAIR_BINS
  static nl_hair_history history;
  nl_hair_history_reset(&history);
#endif
  in.down[1] = -1.0f;
  while (fread(row, sizeof row, 1, stdin) == 1) {
    for (i = 0; i < 4; ++i) {
      in.head[i] = (float)row[4 + i];
      in.neck[i] = (float)row[8 + i];
      in.chest[i] = (float)row[12 + i];
    }
#ifdef NL_HAIR_BINS
    {
      const float place[3] = {(float)row[1], (float)row[2], (float)row[3]};
      nl_hair_history_push(&history, row[0], place, in.head);
      nl_hair_history_read(&history, in.down, in.history);
    }
#endif
    nl_hair_evaluate(&in, &out);
    fwrite(out.turn, sizeof out.turn, 1, stdout);
  }
  return 0;
}
"""


class Rig:
    """The joints of the example's character as a stage moves them."""

    def __init__(self, path):
        self.stage = Usd.Stage.Open(str(path))
        cache = UsdSkel.Cache()
        cache.Populate(UsdSkel.Root(self.stage.GetPrimAtPath("/Body")), Usd.PrimDefaultPredicate)
        self.query = cache.GetSkelQuery(UsdSkel.Skeleton(self.stage.GetPrimAtPath("/Body/Rig")))
        self.names = [joint.rsplit("/", 1)[-1] for joint in self.query.GetJointOrder()]
        self.bind = np.array(self.query.GetJointWorldBindTransforms())

    def world(self, code):
        """(J, 4, 4), with axes as rows: USD multiplies row vectors."""
        return np.array(self.query.ComputeJointSkelTransforms(code))

    def since_bind(self, code, joint):
        """Quaternion wxyz of a joint's world rotation since the bind pose."""
        row = self.names.index(joint)
        now, then = self.world(code)[row, :3, :3].T, self.bind[row, :3, :3].T
        return Rotation.from_matrix(now @ then.T).as_quat()[[3, 0, 1, 2]]


@pytest.mark.parametrize(("dynamic", "mean", "most"), [(True, 0.15, 3.0), (False, 1e-3, 0.01)])
def test_an_engine_turns_the_joints_as_a_bake_does(tmp_path, dynamic, mean, most):
    """The shipped shot at its own 24 frames a second, from the header's documentation alone: differences in degrees."""
    shot = EXAMPLE / "shot.usda"
    model = RigModel.load(None if dynamic else EXAMPLE / "quasi_static.neuralocks")
    export_c(model, tmp_path / "hair.h")
    program = compiled(tmp_path, ENGINE)
    bake_rig(shot, tmp_path / "baked.usda", model)
    rig, baked, codes = Rig(shot), Rig(tmp_path / "baked.usda"), np.arange(1.0, 194.0)
    head, rows = rig.names.index("head"), []
    for code in codes:
        turns = [rig.since_bind(code, joint) for joint in ("head", "neck_01", "spine_03")]
        rows.append(np.concatenate([[code / 24], rig.world(code)[head, 3, :3], *turns]))
    done = subprocess.run([program], input=np.array(rows, "<f8").tobytes(), capture_output=True, check=True)
    turns = np.frombuffer(done.stdout, "<f4").reshape(len(codes), -1, 4).astype(float)
    few = range(0, len(codes), 4)
    off = np.zeros((len(few), turns.shape[1]))
    for line, row in enumerate(few):
        code = codes[row]
        local = np.array(baked.query.ComputeJointLocalTransforms(code))
        for column, (name, parent) in enumerate(zip(model.chains.names, model.chains.parents, strict=True)):
            joint, above = rig.names.index(name), rig.names.index("head" if parent < 0 else model.chains.names[parent])
            bind = rig.bind[above, :3, :3] @ rig.bind[joint, :3, :3].T  # from the joint's axes to its parent's
            engine = bind @ Rotation.from_quat(turns[row, column, [1, 2, 3, 0]]).as_matrix()
            off[line, column] = np.degrees(Rotation.from_matrix(engine.T @ local[joint, :3, :3].T).magnitude())
    assert off.mean() < mean and off.max() < most
    assert np.degrees(Rotation.from_quat(turns[..., [1, 2, 3, 0]].reshape(-1, 4)).magnitude()).mean() > 3
