# SPDX-License-Identifier: GPL-3.0-or-later
"""Two characters with live hair in one scene."""

import gc
import weakref
from pathlib import Path

import bpy

from tests.blender import panel, scenes
from tests.blender.checks import SAME, apart, choose, make_live, messages, points_at

FRAMES = (3, 9, 20)


def one_deleted_while_live(folder: Path) -> None:
    """If the hair of one is deleted while live, that of the other stays as it is, nobody is told of anything, the idle add-on samples
    nothing for the first, and what was prepared for it is not kept; an undo brings it back as it was.
    """
    from dcc_addon import background
    from dcc_addon.session import session

    def by_menu(strands) -> None:
        choose(strands)
        assert bpy.ops.object.delete() == {"FINISHED"}

    deletions = (
        by_menu,
        lambda strands: bpy.data.objects.remove(strands),
        lambda strands: bpy.data.hair_curves.remove(strands.data),
        lambda strands: bpy.context.scene.collection.objects.unlink(strands),
    )
    for delete in deletions:
        scenes.empty()
        for name, way in (("Anna", -1.0), ("Ben", 1.0)):
            rig = scenes.armature(name)
            scenes.body(rig).name = f"Body of {name}"
            scenes.dance(rig)
            rig.delta_location.x = way
            make_live(rig, scenes.hair(rig, 10, name=f"Hair of {name}"))
        hairs = ("Hair of Anna", "Hair of Ben")
        scene, shown = bpy.context.scene, {name: points_at(bpy.data.objects[name], 9) for name in hairs}
        for rig in session.rigs.values():
            rig.stale = False
        before = dict(session.rigs)
        kept = [weakref.ref(session.hairs["Hair of Anna"].hair)]
        kept += [weakref.ref(getattr(session.shown.written["Hair of Anna"], name)) for name in ("rest", "spare")]
        undoing = delete is by_menu and bpy.app.version >= (4, 0)  # without a window, older ones keep no undo steps
        if undoing:
            bpy.ops.ed.undo_push(message="before")
        delete(bpy.data.objects["Hair of Anna"])
        if undoing:
            bpy.ops.ed.undo_push(message="after")
        bpy.context.view_layer.update()
        ben = bpy.data.objects["Hair of Ben"]
        for frame in FRAMES:
            scene.frame_set(frame)
            background.look()
        assert apart(points_at(ben, 9), shown["Hair of Ben"]) == 0.0 and not messages(), messages()
        assert session.rigs == before and not session.rigs["Ben"].stale and not session.sampling.failed
        if "Hair of Anna" not in bpy.data.objects:
            gc.collect()
            assert all(each() is None for each in kept), delete
            assert session.hairs.keys() == session.shown.written.keys() == {"Hair of Ben"}, delete
        scene.neuralocks.armature = bpy.data.objects["Anna"]
        assert not [line for line in panel.drawn("ERROR") if "Hair of" in line]
        scene.neuralocks.armature, scene.neuralocks.hair = bpy.data.objects["Ben"], ben
        assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "two.blend"), copy=True)
        assert apart(points_at(ben, 9), shown["Hair of Ben"]) == 0.0 and not messages(), messages()
        if undoing:
            bpy.ops.ed.undo()
            for name, points in shown.items():
                assert apart(points_at(bpy.data.objects[name], 9), points) < SAME, name
            assert not messages(), messages()
