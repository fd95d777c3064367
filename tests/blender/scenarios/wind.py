# SPDX-License-Identifier: GPL-3.0-or-later
"""A character's wind: in strands and bones alike, at once, and the same in every way to a bake."""

import math
from pathlib import Path
from unittest.mock import patch

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import (
    MODEL,
    SAME,
    apart,
    baked_points,
    bones_at,
    give_bone_model,
    make_live,
    messages,
    needs_usd,
    points_at,
)
from tests.blender.panel import drawn


def wind_in_strands(folder: Path) -> None:
    """Live, operator and Python call agree in a wind; it acts at once, and a calm gives back what was before."""
    rig, strands = scenes.dancer(40)
    make_live(rig, strands, motion=0.7)
    own, frames = rig.neuralocks_character, (20, 3, 12)
    calm = {f: points_at(strands, f) for f in frames}
    own.wind = 6.0
    assert apart(scenes.points(strands), calm[12]) > 1e-4, "it must act at once"
    own.wind_direction, own.gusts = math.radians(250), 0.9
    shown = {f: points_at(strands, f) for f in frames}
    assert not messages(), messages()
    assert min(apart(shown[f], calm[f]) for f in frames) > 1e-4
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "bake.usdc")) == {"FINISHED"}

    from usd.baking.bake import bake
    from usd.review.inspect import inspect

    (groom,) = inspect(folder / "bake.usdc")["grooms"]
    wind, gusts = groom["baked with"]["wind"], groom["baked with"]["gusts"]
    assert np.allclose(wind, [6 * math.cos(math.radians(250)), 6 * math.sin(math.radians(250)), 0], atol=1e-4), wind
    bake(folder / "bake_shot.usdc", folder / "again.usdc", MODEL, strength=0.7, wind=wind, gusts=gusts)
    for f in frames:
        for name in ("bake.usdc", "again.usdc"):
            assert apart(baked_points(folder / name, "/Character/Hair_Hair", f), shown[f]) < SAME, (name, f)
    own.wind = 0.0
    assert max(apart(points_at(strands, f), calm[f]) for f in frames) == 0.0


def wind_on_a_bust(folder: Path) -> None:
    """A character without an animation: its hair moves in gusts, live as in a bake."""
    rig = scenes.armature()
    strands, frames = scenes.hair(rig, 40), (20, 3, 12)
    make_live(rig, strands)
    own = rig.neuralocks_character
    own.wind, own.gusts = 6.0, 1.0
    shown = {f: points_at(strands, f) for f in frames}
    assert not messages(), messages()
    assert min(apart(shown[a], shown[b]) for a, b in ((20, 3), (3, 12))) > 1e-5
    needs_usd()
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 24
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "bust.usdc")) == {"FINISHED"}
    for f in frames:
        assert apart(baked_points(folder / "bust.usdc", "/Character/Hair_Hair", f), shown[f]) < SAME, f


def wind_in_bones(folder: Path) -> None:
    """Live, keyed and exported hair bones agree in a wind; a network for held poses stays as it is, and the panel says so."""
    needs_usd()
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig)
    give_bone_model(rig, folder)
    own, frames = rig.neuralocks_character, (20, 3, 12)
    own.rig_live = True
    hair = [bone.name for bone in rig.pose.bones if bone.name.startswith("hair")]
    calm = {f: bones_at(rig, f, hair) for f in frames}
    own.wind, own.wind_direction = 6.0, math.radians(-60)
    shown = {f: bones_at(rig, f, hair) for f in frames}
    assert not messages(), messages()
    assert min(apart(shown[f], calm[f]) for f in frames) > 1e-3
    assert bpy.ops.neuralocks.export_skel(filepath=str(folder / "rig.usdc")) == {"FINISHED"}
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    assert max(apart(bones_at(rig, f, hair), shown[f]) for f in frames) < SAME
    assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"}
    from usd.shot.stage import read_rigs

    written = read_rigs(folder / "rig.usdc")[0]
    leaves = [name.split("/")[-1] for name in written.character.skeleton.names]
    order, z_up = [leaves.index(name.replace(".", "_")) for name in hair], np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    for f in frames:
        world = np.array(rig.matrix_world) @ shown[f]
        assert apart(z_up @ written.joints_at(f)[order][:, :3, :3], world[:, :3, :3]) < SAME

    own.rig_live = True
    with patch("neuralocks_core.rig.network.RigModel.feels_wind", False):
        assert max(apart(bones_at(rig, f, hair), calm[f]) for f in frames) < SAME
        bpy.context.scene.neuralocks.armature = rig
        assert "they feel no wind" in " ".join(drawn())
        assert bpy.ops.neuralocks.export_skel(filepath=str(folder / "held.usdc")) == {"FINISHED"}
    assert "they feel no wind" not in " ".join(drawn())


def character_deleted(folder: Path) -> None:
    """The panel is drawn, without a word on wind, when the character of hair that feels none has been deleted."""
    rig = scenes.armature()
    strands = scenes.hair(rig, 20)
    make_live(rig, strands)
    rig.neuralocks_character.wind = 3.0
    with patch("neuralocks_core.models.runtime.StrandModel.feels_wind", False):
        assert "hair feels no wind" in " ".join(drawn())
        bpy.data.objects.remove(rig)
        assert "hair feels no wind" not in " ".join(drawn())
