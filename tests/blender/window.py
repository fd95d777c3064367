# SPDX-License-Identifier: GPL-3.0-or-later
"""Run in a window by `test_window`: the steps of an artist, one a tick, so that Blender draws and takes events in
between. What does not hold yet is looked at again: how long a click, the sampling or a bake takes depends on the machine.
"""

import os
import subprocess
import sys
import time
import traceback
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import bpy  # noqa: E402
import numpy as np  # noqa: E402

FOLDER = Path(sys.argv[-1])
TAB, LIVE, TRAIN = 130, 341, 309
"""How far below the top of the sidebar the third tab and the Live button are, and the Train button once the motion is sampled."""
TICK, AGAIN, PATIENCE = 0.4, 12.0, 60.0
"""Seconds from step to step, until a click is repeated, and until what should hold must hold."""
state = {"tick": TICK}


def build():
    """A moving character with hair that is not live yet."""
    import dcc_addon
    from tests.blender import scenes
    from tests.blender.scenarios.training import stand_in

    dcc_addon.register()
    stand_in(FOLDER)
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 24
    rig = scenes.armature()
    scenes.dance(rig)
    scenes.body(rig)
    hair = scenes.hair(rig, 300)
    scene.neuralocks.armature, scene.neuralocks.hair = rig, hair
    hair.neuralocks_hair.model = os.environ["NEURALOCKS_TEST_MODEL"]
    scene.frame_set(12)
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "window.blend"))
    for area in bpy.context.window_manager.windows[0].screen.areas:
        if area.type == "VIEW_3D":
            area.spaces.active.show_region_ui = True
            area.spaces.active.shading.type = "WIREFRAME"
    state["rest"] = shown()


def shown() -> np.ndarray:
    """Points of the hair as they are."""
    data = bpy.data.objects["Hair"].data
    values = np.empty((len(data.points), 3), np.float32)
    data.attributes["position"].data.foreach_get("vector", values.ravel())
    return values


def mouse(below=None, click=False):
    """Move the pointer below the sidebar's top, or click where it is."""
    if click:
        subprocess.run(["xdotool", "click", "1"], check=True)
        return
    window = bpy.context.window_manager.windows[0]
    area = next(a for a in window.screen.areas if a.type == "VIEW_3D")
    side = next(r for r in area.regions if r.type == "UI")
    top = window.height - (side.y + side.height)
    x, y = (side.x + side.width - 12, top + TAB) if below == TAB else (side.x + side.width // 2, top + (below or 300))
    subprocess.run(["xdotool", "mousemove", str(x if below else 300), str(y)], check=True)


def click_again(arrived: bool, clicks: list) -> bool:
    """Whether these clicks are repeated, which have not arrived: on a busy machine, the panel may not have been drawn yet when they
    came. There is twice as much time between them then.
    """
    if arrived or time.monotonic() - state["since"] < AGAIN or state["tick"] > 3:
        return False
    state["tick"] *= 2
    STEPS[1:1] = [*clicks, STEPS[0]]
    return True


def is_live():
    """The click on Live has reached the hair, and sampling runs in the background."""
    live = bpy.data.objects["Hair"].neuralocks_hair.live
    if not click_again(live, TO_LIVE):
        assert live, "the click on Live has not arrived"
        state["tick"] = TICK


def sampled():
    """The background has sampled the motion while Blender was idle: the hair moves."""
    from dcc_addon.session import session

    assert session.rigs and not session.rigs["Rig"].stale and session.sampling.done is None, session.said.messages
    assert np.abs(shown() - state["rest"]).max() > 1e-3
    state["twelve"] = shown()


def scrub():
    """Away and back: the same hair."""
    scene = bpy.context.scene
    scene.frame_set(20)
    assert np.abs(shown() - state["twelve"]).max() > 1e-3
    scene.frame_set(12)
    assert np.abs(shown() - state["twelve"]).max() == 0


def draw_body(drawn: bool):
    """Whether renders draw the body."""
    bpy.data.objects["Body"].hide_render = not drawn


def kept_out_of(*bodies: str):
    """The background has noticed which bodies renders draw."""
    from dcc_addon.session import session

    assert session.rigs["Rig"].bodies == bodies and session.sampling.done is None


def put_hair(height: float):
    """The artist moves the hair object."""
    bpy.data.objects["Hair"].location.z = height


def sampled_at(height: float):
    """The background has noticed that, although the frame has not changed."""
    from dcc_addon.session import session

    first = session.rigs["Rig"].motion.places["Hair"][0]
    assert abs(first[2, 3] - height) < 1e-6 and session.sampling.done is None, first


def in_training():
    """The click on Train has begun a training, of which the panel knows how far it is; meanwhile, the time line can be scrubbed."""
    from dcc_addon.operators.training import job

    running = job()
    if not click_again(running is not None, TO_TRAIN):
        assert running is not None, "the click on Train has not arrived"
        assert running.message == "half", running.message
        state["tick"] = TICK
        scrub()
        (FOLDER / "go").touch()


def trained():
    """The hair moves by the model that came of it: a copy of its own."""
    from dcc_addon.live.models import model_path
    from dcc_addon.session import session

    assert session.said.trained == ("Hair: trained", True), session.said.trained
    assert model_path(bpy.data.objects["Hair"]) == str(FOLDER / "Hair_1.neuralocks")
    scrub()


def bake():
    """From the panel's operator, with progress."""
    window = bpy.context.window_manager.windows[0]
    area = next(a for a in window.screen.areas if a.type == "VIEW_3D")
    region = next(r for r in area.regions if r.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.neuralocks.bake("INVOKE_DEFAULT", filepath=str(FOLDER / "bake.usdc"))


def baked():
    """The bake ended, the frame is where it was, the view as before."""
    assert (FOLDER / "bake.usdc").exists()
    assert bpy.context.scene.frame_current == 12
    assert np.abs(shown() - state["twelve"]).max() < 1e-6


def picture():
    """Of the whole window."""
    bpy.ops.screen.screenshot(filepath=str(FOLDER / "panel.png"))


def _idle():
    """Time to draw."""


TO_LIVE = [lambda: mouse(TAB), lambda: mouse(click=True), _idle, lambda: mouse(LIVE), lambda: mouse(click=True), _idle]
TO_TRAIN = [lambda: mouse(TRAIN), lambda: mouse(click=True), _idle]
STEPS = [build, _idle, mouse, lambda: mouse(click=True), _idle, *TO_LIVE, picture, is_live, sampled, scrub,
         lambda: draw_body(False), lambda: kept_out_of(), lambda: draw_body(True), lambda: kept_out_of("Body"),
         lambda: put_hair(0.02), lambda: sampled_at(0.02), lambda: put_hair(0.0), lambda: sampled_at(0.0),
         *TO_TRAIN, in_training, trained, bake, baked, picture]  # fmt: skip


def tick():
    """Do the next step; exit hard, because nobody closes the window."""
    since = state.setdefault("since", time.monotonic())
    try:
        STEPS[0]()
    except Exception as error:
        if isinstance(error, AssertionError) and time.monotonic() - since < PATIENCE:
            return state["tick"]
        traceback.print_exc()
        sys.stdout.flush()
        os._exit(1)
    del STEPS[0], state["since"]
    if STEPS:
        return state["tick"]
    print("all steps done", flush=True)
    os._exit(0)


# No graphics card draws here: most of the time would go into pixels of the scene.
bpy.context.preferences.system.viewport_aa = "OFF"
bpy.context.preferences.view.show_splash = False
bpy.app.timers.register(tick, first_interval=2.0)
