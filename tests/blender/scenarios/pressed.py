# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators as their buttons run them in a window: slice by slice, with progress, until they are done or Esc is pressed."""

from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import bpy

from tests.blender import scenes
from tests.blender.checks import make_live, messages, refused


def pressed(folder: Path) -> None:
    """Each takes events between two slices, and is done in the end, before which no other begins; Esc leaves nothing half made, and the
    next press works.
    """
    from dcc_addon.session import session

    rig, strands = scenes.dancer(10)
    scene = bpy.context.scene
    make_live(rig, strands)
    out = folder / "hair.usdc"
    scene.neuralocks.output = str(out)
    assert _press("bake", "ESC") == {"CANCELLED"} and not list(folder.iterdir()) and not session.working
    for name in ("sample_motion", "bake", "report_card"):
        assert _press(name) == {"FINISHED"} and not session.working, name
    assert out.exists() and session.said.cards["Hair"] and strands.neuralocks_hair.live
    assert not messages(), messages()


def pressed_for_bones(folder: Path) -> None:
    """Hair bones are found, and their model exported, with progress while the motion is sampled, which is done once."""
    from dcc_addon.session import session

    rig, scene = scenes.armature(bones=scenes.BONES + scenes.TAIL), bpy.context.scene
    scenes.body(rig)
    scenes.dance(rig)
    scene.neuralocks.armature = rig
    assert _press("find_chains", "ESC") == {"CANCELLED"} and not session.rigs
    assert _press("find_chains") == {"FINISHED"} and len(session.said.cards["Rig"]) == 1
    known = session.rigs["Rig"]
    assert _press("find_chains") == {"FINISHED"} and session.rigs["Rig"] is known
    rig.neuralocks_character.rig_model = str(scenes.rig_model(rig, folder / "rig.neuralocks"))
    session.rigs.clear()
    assert (
        _press("export_c", "ESC", filepath=str(folder / "hair.h")) == {"CANCELLED"} and len(list(folder.iterdir())) == 1
    )
    assert _press("export_c", filepath=str(folder / "hair.h")) == {"FINISHED"} and (folder / "hair.h").exists()


def _press(name: str, key: str = "TIMER", **settings) -> set:
    """Run an operator in a window, as Blender does where it has one; `key` is pressed after the first slice."""
    from dcc_addon.operators import base

    window = {name: getattr(bpy, name) for name in ("context", "data")} | {"app": SimpleNamespace(background=False)}
    with (
        patch.object(base, "bpy", SimpleNamespace(**window)),
        patch.object(base, "SLICE", 0.0),
        patch.object(base, "SAMPLED", 0.0),
        patch.object(base.Hardened, "execute", lambda self, context: self.invoke(context, None)),
        bpy.context.temp_override(window=bpy.context.window_manager.windows[0]),
    ):
        assert getattr(bpy.ops.neuralocks, name)(**settings) == {"RUNNING_MODAL"}
        (work,) = base._running
        refused(bpy.ops.neuralocks.sample_motion, work.bl_label, "is still running")
        assert work.modal(bpy.context, SimpleNamespace(type="MOUSEMOVE")) == {"PASS_THROUGH"}
        result = work.modal(bpy.context, SimpleNamespace(type="TIMER"))
        while result == {"RUNNING_MODAL"}:
            result = work.modal(bpy.context, SimpleNamespace(type=key))
        return result
