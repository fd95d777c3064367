# SPDX-License-Identifier: GPL-3.0-or-later
"""What takes the place of hair or body: other hair, by its name or by its curves, or the same in another type."""

from pathlib import Path
from unittest import SkipTest
from unittest.mock import patch

import bpy
import numpy as np

from dcc_addon.scene.hair import curves
from tests.blender import scenes
from tests.blender.checks import MODEL, SAME, apart, choose, make_live, messages, points_at, refused


def later_groom(folder: Path) -> None:
    """A groom that is appended under the name of a deleted one, with as many strands, is shown from then on."""
    expected, file = [], str(folder / "groom.blend")
    for length in (0.4, 0.2):
        scenes.empty()
        rig, strands = scenes.dancer(20, length=length)
        make_live(rig, strands)
        expected.append(points_at(strands, 9))
        if length == 0.4:
            strands.parent, strands.neuralocks_hair.armature = None, None
            bpy.ops.wm.save_as_mainfile(filepath=file)
    data = strands.data
    bpy.data.objects.remove(strands)
    bpy.data.hair_curves.remove(data)
    with bpy.data.libraries.load(file) as (_, wanted):
        wanted.objects = ["Hair"]
    strands = wanted.objects[0]
    bpy.context.scene.collection.objects.link(strands)
    strands.parent = rig
    bpy.context.scene.neuralocks.hair = strands
    assert strands.name == "Hair" and bpy.ops.neuralocks.assign() == {"FINISHED"}
    assert apart(scenes.points(strands), expected[0]) < SAME < apart(*expected)
    assert apart(points_at(strands, 9), expected[0]) < SAME and not messages(), messages()


def character_gone(_folder: Path) -> None:
    """When the character of live hair is deleted, the hair is at rest and told so at once; it is live again after Attach."""
    for by_script in (True, False):
        scenes.empty()
        rig, strands = scenes.dancer(20)
        rest = curves.points(strands.data)
        make_live(rig, strands)
        live = points_at(strands, 9)
        assert apart(curves.shown(strands.data), rest) > 0.01
        if by_script:
            bpy.data.objects.remove(rig)
        else:
            choose(rig)
            bpy.ops.object.delete()
        bpy.context.view_layer.update()
        assert apart(curves.shown(strands.data), rest) == 0, "it hangs where the character was"
        assert "no armature in this scene" in messages()["Hair"]
        bpy.context.scene.neuralocks.armature = rig = scenes.armature("Other")
        scenes.dance(rig)
        strands.parent = rig
        assert bpy.ops.neuralocks.assign() == {"FINISHED"} and bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
        assert apart(points_at(strands, 9), live) < SAME and not messages(), messages()


def exchanged(_folder: Path) -> None:
    """Two live hairs swap names, and curves: each keeps moving, at once, and both come to rest."""
    rig = scenes.armature()
    scenes.dance(rig)
    first, second = scenes.hair(rig, 20), scenes.hair(rig, 20, length=0.4, name="Other")
    second.neuralocks_hair.model = MODEL
    make_live(rig, first)
    second.neuralocks_hair.live = True
    rest = [curves.points(hair.data) for hair in (first, second)]
    shown = [points_at(hair, 9) for hair in (first, second)]

    for things in ((first, second), (first.data, second.data)):
        names = [thing.name for thing in things]
        things[0].name = "Meanwhile"
        things[1].name, things[0].name = names
        for hair, points in zip((first, second), shown, strict=True):
            assert apart(points_at(hair, 9), points) < SAME and not messages(), messages()
    first.data, second.data = second.data, first.data
    bpy.context.view_layer.update()
    assert apart(scenes.points(first), shown[1]) < SAME and apart(scenes.points(second), shown[0]) < SAME
    assert not messages(), messages()
    first.neuralocks_hair.live = second.neuralocks_hair.live = False
    assert np.array_equal(curves.shown(first.data), rest[1]) and np.array_equal(curves.shown(second.data), rest[0])


def renamed_back(_folder: Path) -> None:
    """Live hair keeps moving at every new name, also at one that it had before, and already while it is sampled anew."""
    from dcc_addon import background

    rig, strands = scenes.dancer(20)
    make_live(rig, strands)
    shown = {frame: points_at(strands, frame) for frame in (14, 9)}
    for name in ("Wig", "Hair", "Wig"):
        strands.name = name
        with patch.object(background, "request") as asked:
            bpy.context.view_layer.update()
        assert asked.called, f"nobody has noticed the name {name}"
        while background.look() is not None:
            pass
        for frame in shown:
            assert apart(points_at(strands, frame), shown[frame]) < SAME and not messages(), (name, messages())
    for name in ("Hair", "Wig"):
        strands.name = name
        bpy.context.view_layer.update()
    assert strands.neuralocks_hair.live
    while background.look() is not None:
        pass
    assert apart(scenes.points(strands), shown[9]) < SAME and not messages(), messages()


def converted(_folder: Path) -> None:
    """For live hair that is converted to a mesh, a message says that it is no longer hair, and it is not damaged; a chosen body
    that is converted to curves is ignored.
    """
    if bpy.app.version < (3, 5):
        raise SkipTest("older ones convert no hair")
    rig = scenes.armature()
    skin, other = scenes.body(rig), scenes.body(rig)
    scenes.dance(rig)
    strands, operators = scenes.hair(rig, 20), bpy.ops.neuralocks
    rig.neuralocks_character.body = skin
    make_live(rig, strands)
    skin.data.clear_geometry()  # faces do not become curves
    skin.data.from_pydata([(0, 0, 0), (0, 0, 1)], [(0, 1)], [])
    for thing, kind in ((skin, "CURVE"), (strands, "MESH")):
        for each in bpy.data.objects:
            each.select_set(each == thing)
        bpy.context.view_layer.objects.active = thing
        assert bpy.ops.object.convert(target=kind) == {"FINISHED"}
        bpy.context.scene.frame_set(9)
        assert thing.type == kind and operators.sample_motion() == {"FINISHED"}
    assert not messages(), messages()
    from dcc_addon.session import session

    assert session.rigs["Rig"].bodies == (other.name,)
    for refuse in (
        operators.bake_attach,
        operators.detach,
        operators.report_card,
        operators.reset_look,
        operators.assign,
    ):
        refused(refuse, "Hair: it is no longer a hair Curves object")
    strands.neuralocks_hair.live = False
    strands.neuralocks_hair.live = True
