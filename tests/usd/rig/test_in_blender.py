# SPDX-License-Identifier: Apache-2.0
"""A rig bake opens in real Blenders with the hair bones moving and every other bone as before."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from neuralocks_core.rig import RigModel
from usd.rig.bake import bake_rig

from ...blenders import VERSIONS, python_of

ROOT = Path(__file__).parents[3]
SHOT = ROOT / "examples" / "mesh_hair" / "shot.usda"
FRAMES = (1, 20, 47, 90, 131, 160)

SCRIPT = """
import os, sys
import bpy, numpy as np
found = {}
for path, out in zip(sys.argv[2::2], sys.argv[3::2]):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=path)
    rig = next(o for o in bpy.data.objects if o.type == "ARMATURE")
    posed = []
    for frame in map(int, sys.argv[1].split(",")):
        bpy.context.scene.frame_set(frame)
        posed.append([np.array(bone.matrix) for bone in rig.pose.bones])
    rest = [np.array(bone.bone.matrix_local) for bone in rig.pose.bones]
    np.savez(out, names=[bone.name for bone in rig.pose.bones], posed=posed, rest=rest)
sys.stdout.flush()
os._exit(0)
"""


@pytest.mark.parametrize("version", VERSIONS)
def test_only_hair_bones_move_otherwise(tmp_path, version):
    """Pose and rest matrices of every bone, before and after, at frames of each kind of motion in the shot."""
    python = python_of(version)
    model = RigModel.load()
    result = bake_rig(SHOT, tmp_path / "baked.usda", model)
    words = [
        python,
        "-c",
        SCRIPT,
        ",".join(map(str, FRAMES)),
        SHOT,
        tmp_path / "a.npz",
        result.path,
        tmp_path / "b.npz",
    ]
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=240)
    assert (tmp_path / "b.npz").exists(), done.stdout[-2000:] + done.stderr[-2000:]
    with np.load(tmp_path / "a.npz") as before, np.load(tmp_path / "b.npz") as after:
        names = list(before["names"])
        assert names == list(after["names"])
        hair = np.isin(names, model.chains.names)
        assert hair.sum() == len(model.chains)
        assert (before["rest"] == after["rest"]).all()
        change = np.abs(after["posed"] - before["posed"]).max(axis=(2, 3))
        assert change[:, ~hair].max() == 0
        turns = np.swapaxes(before["posed"][..., :3, :3], -1, -2) @ after["posed"][..., :3, :3]
        degrees = np.degrees(np.arccos(np.clip((np.trace(turns, axis1=-2, axis2=-1) - 1) / 2, -1, 1)))
        assert degrees[:, hair].max(axis=0).min() > 1, "every hair bone turns at some frame"
        assert np.ptp(degrees[:, hair], axis=0).min() > 0.5
