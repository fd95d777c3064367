# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair objects that an artist joins, which Blender can since 5.2: no groom is lost, whichever of them was live."""

from pathlib import Path
from unittest import SkipTest

import bpy
import numpy as np
from mathutils import Matrix

from neuralocks_core.rotation import transformed
from tests.blender import scenes
from tests.blender.checks import MODEL, apart, make_live, messages, points_at

TURNED = scenes.translation((0.4, 0.2, 0.5)) @ Matrix.Rotation(0.7, 4, "X") @ Matrix.Scale(1.5, 4)


def joined_to_resting(folder: Path) -> None:
    """Live hair joined to hair that is not live comes to rest; saved or made live, all strands keep their groom."""
    from dcc_addon.scene.hair import curves

    if bpy.app.version < (5, 2):
        raise SkipTest("curves cannot be joined yet")
    strands, grooms = _joined()
    assert not strands.neuralocks_hair.live and not curves.has_rest(strands.data)
    assert apart(curves.shown(strands.data), grooms) == 0.0
    strands.neuralocks_hair.live = True
    bpy.context.scene.frame_set(12)
    assert not messages(), messages()
    assert apart(curves.shown(strands.data), grooms) > 1e-3 and apart(curves.points(strands.data), grooms) == 0.0
    strands.neuralocks_hair.live = False
    assert apart(curves.shown(strands.data), grooms) == 0.0

    scenes.empty()
    strands, grooms = _joined(followed=False)
    assert curves.has_rest(strands.data)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "joined.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "joined.blend"))
    data = bpy.data.objects["Hair"].data
    assert not curves.has_rest(data) and apart(curves.shown(data), grooms) == 0.0


def joined_standing_differently(_folder: Path) -> None:
    """Live hairs with different transforms keep their grooms in the world when they are joined, whichever of them is live, also
    after undo and redo, and if one is a copy of the other.
    """
    from dcc_addon.scene.hair import curves

    if bpy.app.version < (5, 2):
        raise SkipTest("curves cannot be joined yet")
    for live, copied in ((("Hair", "Other"), False), (("Other",), False), (("Hair", "Other"), True)):
        scenes.empty()
        rig = scenes.armature()
        scenes.dance(rig)
        strands, other = scenes.hair(rig, 20), scenes.hair(rig, 20 if copied else 15, name="Other", length=0.2)
        other.matrix_basis = TURNED
        if copied:
            curves.write(other.data, curves.shown(strands.data))
            other.matrix_basis = scenes.translation((0, 0.03, 0.01))
        else:
            curves.write(other.data, transformed(curves.shown(other.data), np.linalg.inv(np.array(TURNED))))
        bpy.context.view_layer.update()
        grooms = np.concatenate([_world(strands, scenes.points(strands)), _world(strands, scenes.points(other))])
        for name in live:
            make_live(rig, bpy.data.objects[name])
        bpy.context.scene.frame_set(9)
        before = np.concatenate([scenes.points(strands), scenes.points(other)])
        bpy.ops.ed.undo_push(message="before")
        _join(strands, other, followed=False)
        bpy.ops.ed.undo_push(message="joined")  # Blender does this before it calls handlers
        if "Hair" in live:
            assert apart(points_at(strands, 9), before) < 0.1  # in other locks, but at the same place
        strands.update_tag()
        bpy.context.view_layer.update()
        assert apart(curves.points(strands.data), grooms) < 2e-6, (live, copied)
        bpy.ops.object.select_all(action="DESELECT")
        bpy.ops.ed.undo_push(message="another step")
        for step in (bpy.ops.ed.undo, bpy.ops.ed.undo, bpy.ops.ed.redo):
            step()
            now = curves.points(bpy.data.objects["Hair"].data)
            assert apart(now, grooms[: len(now)]) < 2e-6, (live, copied, step)
        bpy.data.objects["Hair"].neuralocks_hair.live = False
        assert apart(curves.shown(bpy.data.objects["Hair"].data), grooms) < 2e-6


def root_at_the_origin(_folder: Path) -> None:
    """A point exactly at the origin of its object rests there, and is not mistaken for one without a rest shape."""
    from dcc_addon.scene.hair import curves

    rig, strands = scenes.dancer(20)
    root = curves.shown(strands.data)[0].copy()
    curves.write(strands.data, curves.shown(strands.data) - root)
    strands.location = root
    signed = curves.shown(strands.data)
    signed[0], signed[5, 0], signed[9, 1:] = (0.0, -0.0, -0.0), -0.0, -0.0
    curves.write(strands.data, signed)
    groom = curves.points(strands.data)
    assert not groom[0].any()
    make_live(rig, strands)
    bpy.context.scene.frame_set(9)
    bpy.context.scene.frame_set(14)
    assert curves.shown(strands.data)[0].any() and apart(curves.points(strands.data), groom) == 0.0
    strands.neuralocks_hair.live = False
    assert curves.shown(strands.data).tobytes() == signed.tobytes(), "also which zeros are negative"


def _joined(followed: bool = True):
    """Resting hair to which moved hair was joined, and the grooms of both; `followed`: the add-on has heard of it."""
    from dcc_addon.scene.hair import curves

    rig = scenes.armature()
    scenes.dance(rig)
    strands, other = scenes.hair(rig, 20), scenes.hair(rig, 15, name="Other", length=0.2)
    other.neuralocks_hair.model = strands.neuralocks_hair.model = MODEL
    make_live(rig, other)
    bpy.context.scene.frame_set(9)
    grooms = np.concatenate([curves.points(strands.data), curves.points(other.data)])
    _join(strands, other, followed)
    return strands, grooms


def _join(strands, other, followed: bool) -> None:
    """Join hair to other hair; `followed`: the add-on has heard of it."""
    from dcc_addon.handlers import on_update

    for thing in bpy.data.objects:
        thing.select_set(thing in (strands, other))
    bpy.context.view_layer.objects.active = strands
    if not followed:
        bpy.app.handlers.depsgraph_update_post.remove(on_update)
    try:
        bpy.ops.object.join()
        bpy.context.view_layer.update()
    finally:
        if not followed:
            bpy.app.handlers.depsgraph_update_post.append(on_update)


def _world(thing, points: np.ndarray) -> np.ndarray:
    """Points (P, 3) of the world in the space of an object."""
    return transformed(points, np.linalg.inv(np.array(thing.matrix_world)))
