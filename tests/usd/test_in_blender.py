# SPDX-License-Identifier: Apache-2.0
"""A bake opens in a real Blender as moving hair, frame for frame."""

import subprocess

import numpy as np
import pytest

from usd.baking.bake import bake

from ..blenders import installed
from .shots import Recipe, samples, world_points, write_shot

PYTHONS = installed()

SCRIPT = """
import os, sys
import bpy, numpy as np
for path, out in zip(sys.argv[1::2], sys.argv[2::2]):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=path)
    hair = next(o for o in bpy.data.objects if o.type == "CURVES")
    # Blender before 4.5 reads stage units as metres.
    found = {"scaled": "apply_unit_conversion_scale" in bpy.ops.wm.usd_import.get_rna_type().properties}
    for frame in (1, 4, 9):
        bpy.context.scene.frame_set(frame)
        seen = hair.evaluated_get(bpy.context.evaluated_depsgraph_get())
        points = np.empty(3 * len(seen.data.points), np.float32)
        seen.data.attributes["position"].data.foreach_get("vector", points)
        matrix = np.array(seen.matrix_world)
        found[str(frame)] = points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
        # Blender before 4.5 does not read velocities of curves.
        if bpy.app.version >= (4, 5):
            seen.data.attributes["velocity"].data.foreach_get("vector", points)
            found[f"velocity {frame}"] = points.reshape(-1, 3) @ matrix[:3, :3].T
    np.savez(out, **found)
sys.stdout.flush()
os._exit(0)
"""


RECIPES = {"m_y_up": Recipe(), "cm_z_up": Recipe(unit=0.01, up="Z", bound="mesh")}


@pytest.fixture(scope="module")
def bakes(tmp_path_factory, model):
    """Path of a bake of each recipe."""
    folders = {name: tmp_path_factory.mktemp(name) for name in RECIPES}
    return {
        name: bake(write_shot(folders[name], RECIPES[name]), folders[name] / "bake.usdc", model).path
        for name in RECIPES
    }


@pytest.mark.skipif(
    not PYTHONS, reason="no Blender is installed as a Python module (make blender installs 4.2 and 5.2)"
)
@pytest.mark.parametrize("python", PYTHONS or [None], ids=lambda path: path.parents[1].name if path else "none")
def test_blender_shows_the_baked_points(tmp_path, bakes, python):
    """One Blender for all: most of the time it starts."""
    outs = {name: tmp_path / f"{name}.npz" for name in bakes}
    words = [word for name in bakes for word in (bakes[name], outs[name])]
    done = subprocess.run([python, "-c", SCRIPT, *map(str, words)], capture_output=True, text=True, timeout=240)
    for name, out in outs.items():
        assert out.exists(), (name, done.stdout[-2000:] + done.stderr[-2000:])
        with np.load(out) as seen:
            _compare(seen, bakes[name], RECIPES[name])


def _compare(seen, path, recipe: Recipe) -> None:
    """Points and velocities as Blender shows them are those of the bake."""
    unit = 1.0 if seen["scaled"] else recipe.unit
    for frame in (1, 4, 9):
        x, y, z = world_points(path, float(frame)).T
        assert np.abs(unit * seen[str(frame)] - np.stack([x, -z, y], axis=1)).max() < 2e-5
        if f"velocity {frame}" in seen:
            x, y, z = samples(path, "velocities", at=float(frame)).T * recipe.unit
            expected = np.stack([x, -z, y] if recipe.up == "Y" else [x, y, z], axis=1)
            assert np.abs(unit * seen[f"velocity {frame}"] - expected).max() < 1e-3 * np.abs(expected).max() + 1e-5
