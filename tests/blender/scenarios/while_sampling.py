# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist does while motion is sampled in the background, a slice at a time."""

from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import bpy

from tests.blender import scenes
from tests.blender.checks import MODEL, apart, make_live, messages, points_at


@patch("dcc_addon.background.PAUSE", 0.0)
@patch("dcc_addon.background.SLICE", 0.0)
def scrubbed_while_sampling(_folder: Path) -> None:
    """An artist who scrubs before the motion is sampled for the first time, or anew, sees each frame as long as wished, and does not
    keep sampling from its end; an edited key begins it again.
    """
    from dcc_addon import background
    from dcc_addon.session import session

    rig, strands = scenes.dancer(10)
    own, scene = strands.neuralocks_hair, bpy.context.scene
    window = SimpleNamespace(
        app=SimpleNamespace(background=False, timers=bpy.app.timers, is_job_running=bpy.app.is_job_running),
        context=bpy.context,
    )

    def scrub(looks: int) -> bool:
        """Whether sampling ends."""
        for look in range(looks):
            scene.frame_set(2 + look % 20)
            shown = scene.frame_current
            ended = background.look() is None
            assert scene.frame_current == shown
            if ended:
                return True
        return False

    with (
        patch.object(background, "bpy", window),
        patch.object(background, "in_slices", wraps=background.in_slices) as begun,
    ):
        own.model, own.live = MODEL, True
        assert scrub(60) and begun.call_count == 1
        assert not session.rigs["Rig"].stale and not messages(), messages()
        session.rigs["Rig"].stale = True
        background.request()
        assert not scrub(10)
        scene.frame_set(5)
        rig.pose.bones["head"].rotation_euler.y += 0.5
        rig.pose.bones["head"].keyframe_insert("rotation_euler", frame=5)
        bpy.context.view_layer.update()
        assert scrub(60) and begun.call_count == 3
    assert not session.rigs["Rig"].stale and not messages(), messages()
    assert apart(points_at(strands, 5), points_at(strands, 9)) > 1e-3


@patch("dcc_addon.background.SLICE", 0.0)
def renamed_while_sampling(_folder: Path) -> None:
    """If hair or a body is renamed, added or deleted meanwhile, what is there then is sampled, and nobody is told of an error; nothing is
    sampled for hair that is gone, or no longer live.
    """
    from dcc_addon import background
    from dcc_addon.session import session

    def rename(strands) -> None:
        strands.name = "Fringe"
        bpy.data.objects["Body"].name = "Skin"

    def add(strands) -> None:
        scenes.hair(strands.parent, 5, name="Beard")

    def switch_off(strands) -> None:
        strands.neuralocks_hair.live = False

    for change, hair, bodies in (
        (rename, {"Fringe"}, ("Skin",)),
        (add, {"Hair", "Beard"}, ("Body",)),
        (lambda strands: bpy.data.objects.remove(bpy.data.objects["Body"]), {"Hair"}, ()),
        (lambda strands: bpy.data.objects.remove(strands), None, None),  # `bpy.data` of the scene that is open then
        (lambda strands: bpy.data.objects.remove(strands.parent), None, None),
        (switch_off, None, None),
    ):
        scenes.empty()
        rig, strands = scenes.dancer(10, skinned=True)
        make_live(rig, strands)
        before = session.rigs["Rig"]
        before.stale = True
        for _ in range(8):
            background.look()
        assert session.sampling.done
        change(strands)
        for _ in range(90):
            if background.look() is None:
                break
        assert session.sampling.done is None and not session.sampling.failed, change
        assert not {"Rig", "Fringe", "Beard"} & messages().keys(), messages()
        after = session.rigs["Rig"]
        assert (after is before) == (hair is None)
        if hair is not None:
            assert not after.stale and after.bodies == bodies
            assert hair == after.motion.places.keys() - {"", *bodies}


def renamed_while_asked_for(_folder: Path) -> None:
    """The same while an operator samples, whose work ends only with the armature's."""
    from dcc_addon.scene.motion.sampling import in_slices
    from dcc_addon.session import session
    from neuralocks_core.errors import NeuralocksError

    rig, strands = scenes.dancer(10)
    steps = in_slices(bpy.context, rig, 0.0)
    while next(steps)[0] < 12:
        pass
    strands.name = "Fringe"
    reached = [done for done, _ in steps]
    assert reached[0] == 0 and reached[-1] == 24
    assert session.rigs["Rig"].motion.places.keys() == {"", "Fringe"}
    steps = in_slices(bpy.context, rig, 0.0)
    next(steps)
    rig.name = "Character"
    try:
        next(steps)
    except NeuralocksError as error:
        assert "deleted or renamed" in str(error)
    else:
        raise AssertionError("what was sampled is stored for nobody")
