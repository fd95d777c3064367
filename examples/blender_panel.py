# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of the panel with live hair, in a real window:

    xvfb-run -s "-screen 0 1280x960x24" blender --factory-startup -p 0 0 1280 960 \\
        --python examples/blender_panel.py -- OUT.png

`--model FILE` chooses a model, `--frame N` the frame. Needs a Blender with a window; the packages of the add-on must be
importable (install the extension, or set PYTHONPATH). If VIRTUAL_ENV has no torch, the panel says how to get it.
"""

import argparse
import math
import os
import shutil
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import blender_clip
import blender_shot
import bpy
from mathutils import Euler, Vector


def options():
    """The options after `--`."""
    parser = argparse.ArgumentParser()
    parser.add_argument("out", type=Path)
    parser.add_argument("--model", default="")
    parser.add_argument("--frame", type=int, default=76)
    parser.add_argument("--strands", type=int)
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1 :])


def prepare(wanted) -> None:
    """Build the scene, make the hair live, aim the view, open the sidebar."""
    import dcc_addon

    if not hasattr(bpy.types.Scene, "neuralocks"):
        dcc_addon.register()
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    armature, _, hair = blender_shot.build(strands=wanted.strands)
    armature.hide_set(True)
    # As for an artist: the file saved, the model beside it.
    folder = Path(tempfile.mkdtemp())
    if wanted.model:
        shutil.copy(wanted.model, folder / "hair.neuralocks")
        hair.neuralocks_hair.model = "//hair.neuralocks"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    bpy.ops.neuralocks.sample_motion()
    hair.neuralocks_hair.live = True
    bpy.context.scene.frame_set(wanted.frame)
    for area in bpy.context.window_manager.windows[0].screen.areas:
        if area.type == "VIEW_3D":
            _view(area, armature)


def _view(area, armature) -> None:
    """Material Preview with the lights of the clip; the head is left of the sidebar."""
    scene, space = bpy.context.scene, area.spaces.active
    blender_clip.stage(armature)
    scene.render.hair_subdiv = 2
    if hasattr(scene.eevee, "use_gtao"):  # newer versions shade corners by themselves
        scene.eevee.use_gtao, scene.eevee.gtao_distance = True, 0.05
    space.show_region_ui, space.overlay.show_overlays = True, False
    shading = space.shading
    shading.type, shading.use_scene_lights, shading.use_scene_world = "MATERIAL", True, False
    shading.studiolight_intensity = 0.35
    head = armature.matrix_world @ armature.pose.bones[_head(armature)].matrix
    region = space.region_3d
    region.view_perspective = "PERSP"
    region.view_rotation = Euler((math.radians(84), 0, math.radians(ROUND))).to_quaternion()
    region.view_location = head.to_translation() + region.view_rotation @ Vector(ASIDE)
    region.view_distance = 0.56
    for part in area.regions:
        if part.type == "UI" and hasattr(part, "active_panel_category"):
            try:
                part.active_panel_category = "Neuralocks"
            except (AttributeError, TypeError):
                pass


def _head(armature) -> str:
    from dcc_addon.session import session

    sampled = session.rigs[armature.name]
    return sampled.rig.bones[sampled.character.head]


def clicks() -> list:
    """What an artist does to see the panel: click the tab, draw the sidebar wider. Python cannot do this before Blender 4.2.

    One event per step: Blender handles a click at the pointer's position at that time, not at the position of the event.
    """
    window = bpy.context.window_manager.windows[0]
    area = next(a for a in window.screen.areas if a.type == "VIEW_3D")
    side = next(r for r in area.regions if r.type == "UI")
    top = window.height - (side.y + side.height)
    tab, edge = f"mousemove {side.x + side.width - 12} {top + TAB}", f"mousemove {side.x} {top + 400}"
    # The first click may only close the splash screen.
    way = ["mousemove 120 700", "click 1", tab, "click 1", edge, "mousedown 1"]
    way += [f"mousemove {side.x - step} {top + 400}" for step in (30, 60, 90)] + ["mouseup 1", "mousemove 8 500"]
    return [lambda step=step: subprocess.Popen(["xdotool", *step.split()]) for step in way]


ROUND = 36
"""How far the view is turned to the character's left [degrees]."""
ASIDE = (0.04, -0.03, 0)
"""Point that the view looks at, relative to the head joint [m]: to its right and up."""
TAB = 130
"""Distance of the third tab below the top of the sidebar."""


def main() -> None:
    """Run the steps with pauses in between, so that the window can draw."""
    wanted = options()
    steps = [lambda: prepare(wanted), lambda: steps.extend([*clicks(), lambda: None, lambda: _shoot(wanted.out)])]

    def tick():
        try:
            steps.pop(0)()
        except Exception:
            traceback.print_exc()
            os._exit(1)
        if steps:
            return 1.5
        os._exit(0)

    bpy.context.preferences.view.show_splash = False
    bpy.app.timers.register(tick, first_interval=2.0)


def _shoot(out: Path) -> None:
    out.parent.mkdir(parents=True, exist_ok=True)
    bpy.ops.screen.screenshot(filepath=str(out))


main()
