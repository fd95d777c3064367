# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension as artists install it: from its zip, which brings all packages that a bake needs.

Only where NEURALOCKS_BLENDERS chooses versions, as `make matrix` does: the wheels in the zip are downloaded once, 120 MB.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from pxr import Usd

from dcc_addon import build

from .. import blenders

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = """
import os, sys
from pathlib import Path
import bpy
archive, shot, out, own = sys.argv[1:]
bpy.ops.extensions.package_install_files(filepath=archive, repo="user_default", enable_on_install=True)
# The program Blender has no other packages; those of this environment would come first.
sys.path.sort(key=lambda entry: not entry.startswith(own))
import neuralocks_core, onnxruntime, pxr, usd
for package in (neuralocks_core, onnxruntime, pxr, usd):
    assert Path(own) in Path(package.__file__).parents, package.__file__
bpy.ops.wm.usd_import(filepath=shot)
scene = bpy.context.scene
assert bpy.ops.neuralocks.find() == {"FINISHED"}
hair = scene.neuralocks.hair
scene.frame_start, scene.frame_end, scene.neuralocks.output = 1, 3, out
assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"}
assert "Neuralocks Cache" in hair.modifiers
print("held", flush=True)
os._exit(0)
"""


@pytest.fixture(scope="module")
def archive(tmp_path_factory) -> Path:
    """The zip for this platform."""
    if not os.environ.get("NEURALOCKS_BLENDERS"):
        pytest.skip("downloads 120 MB; set NEURALOCKS_BLENDERS to versions, or run make matrix")
    if sys.platform != "linux":
        pytest.skip("the zip for linux-x64 is tested")
    folder = tmp_path_factory.mktemp("dist")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["build.py", "--platform", "linux-x64", "--no-legacy", "-o", str(folder)])
        assert build.main() == 0
    return next(folder.glob("*.zip"))


@pytest.mark.parametrize("version", [v for v in blenders.asked_for() if v != blenders.PROGRAM])
def test_the_zip_installs_and_bakes(version, archive, tmp_path):
    shot, out, own = ROOT / "examples" / "shot" / "shot.usda", tmp_path / "hair.usdc", tmp_path / "resources"
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "BLENDER"))}
    command = [str(blenders.python_of(version)), "-c", SCRIPT, *map(str, (archive, shot, out, own))]
    environment = kept | {"BLENDER_USER_RESOURCES": str(own)}
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert "held" in done.stdout.splitlines(), (done.stdout + done.stderr)[-4000:]
    assert Usd.Stage.Open(str(out)).GetStartTimeCode() == 1
