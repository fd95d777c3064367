# SPDX-License-Identifier: GPL-3.0-or-later
"""With the USD that Blender brings along, which the extension uses on Windows, a bake is the same."""

import os
import subprocess
from pathlib import Path

import pytest
from pxr import Sdf

from usd.baking.bake import bake

from .. import blenders

ROOT = Path(__file__).resolve().parents[2]
SHOT = ROOT / "examples" / "shot" / "shot.usda"
SCRIPT = """
import sys, bpy
from pathlib import Path
(own,) = (Path(bpy.__file__).parents[3] / "python").glob("**/site-packages/pxr")
sys.path.insert(0, str(own.parent))
import pxr
assert Path(pxr.__file__).parent == own, pxr.__file__
from usd.baking.bake import bake
bake(sys.argv[1], sys.argv[2], frames="1:2")
"""


@pytest.mark.skipif(not SHOT.exists(), reason="examples/shot is not in this checkout")
@pytest.mark.parametrize("version", ["4.5", "5.0", "5.2"])
def test_a_bake_with_blenders_own_usd_is_the_same(version, tmp_path):
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "BLENDER"))}
    command = [str(blenders.python_of(version)), "-c", SCRIPT, str(SHOT), str(tmp_path / "theirs.usda")]
    done = subprocess.run(command, env=kept | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=120)
    assert (tmp_path / "theirs.usda").exists(), done.stdout + done.stderr
    bake(SHOT, tmp_path / "ours.usda", frames="1:2")
    theirs, ours = (Sdf.Layer.FindOrOpen(str(tmp_path / name)) for name in ("theirs.usda", "ours.usda"))
    assert theirs.ExportToString() == ours.ExportToString()
