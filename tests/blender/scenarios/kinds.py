# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair that names no model moves by the shipped one that knows such hair."""

from pathlib import Path

import bpy
import numpy as np

from dcc_addon.interface.hair_notes import unnamed_model
from tests.blender.checks import SAME, apart, baked_points, make_live, points_at


def short_hair(folder: Path) -> None:
    """Live as in a bake of the stage, and the panel says by which."""
    from pxr import Usd

    from examples import blender_shot
    from usd.assets.grow import grow
    from usd.baking.bake import bake
    from usd.shot.stage import read_shot

    shot = grow("pixie", blender_shot.SHOT, folder / "shot.usda", count=150, seed=7001, with_character=True)
    stage = Usd.Stage.Open(str(shot))
    stage.OverridePrim("/Body/Hair").SetActive(False)
    stage.Save()
    (groom,) = read_shot(shot).grooms
    armature, _, strands = blender_shot.build(shot)
    assert unnamed_model(strands) == "Shipped with the add-on"  # which of them is not known yet
    make_live(armature, strands)
    strands.neuralocks_hair.model = ""
    bpy.context.scene.frame_set(40)
    assert unnamed_model(strands) == "Shipped with the add-on: short hair"
    result = bake(shot, folder / "hair.usdc", frames=[40, 90], velocities=False)
    assert [told["model"] for told in result.grooms] == ["strands_short"]
    y_up = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    for frame in (90, 40):
        assert apart(points_at(strands, frame), baked_points(result.path, groom.path, frame) @ y_up.T) < SAME
