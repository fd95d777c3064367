# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair and bodies that are not in view while the motion is sampled."""

from pathlib import Path

import bpy

from dcc_addon.scene.motion.up_to_date import ensure, notice
from dcc_addon.session import session
from tests.blender import scenes
from tests.blender.checks import SAME, apart, baked_points, make_live, messages, points_at


def hidden_hair(folder: Path) -> None:
    """Hair attached in any way is baked where it would be shown, even in an excluded collection or disabled."""
    ways = {"disabled": _disable, "excluded": _exclude, "both": _disable_unseen}
    for number, (hang, hidden) in enumerate(
        (
            (_child_of, ("excluded", "both")),
            (_keyed, ("disabled",)),
            (_vertex, ("excluded", "both")),
            (_below_keyed, ("disabled", "excluded")),
            (_on_bone, ("excluded",)),
            (_on_relative_bone, ("disabled",)),
        )
    ):
        shown = _baked(folder / f"{number}_shown.usdc", hang, lambda strands: None)
        for way, hide in ((way, ways[way]) for way in hidden):
            here = _baked(folder / f"{number}_{way}.usdc", hang, hide)
            assert all(apart(here[f], shown[f]) < SAME for f in shown), (hang.__name__, way)


def swapped_in(_folder: Path) -> None:
    """Hair and body whose visibility is keyed, hidden at the first frame, move as if they were shown throughout; so does
    hair beside a body that is disabled.
    """
    found = []
    for way in ("shown", "keyed", "disabled"):
        scenes.empty()
        rig = scenes.armature()
        scenes.dance(rig)
        skin, strands = scenes.body(rig), scenes.hair(rig, 20)
        skin.shape_key_add(name="Basis")
        wide = skin.shape_key_add(name="wide")
        for point in wide.data:
            point.co.x *= 1.4
        for frame, value in ((1, 0.0), (24, 1.0)):
            wide.value = value
            wide.keyframe_insert("value", frame=frame)
        for thing in (skin, strands) if way == "keyed" else ():
            for frame, off in ((1, True), (8, False)):
                thing.hide_viewport = off
                thing.keyframe_insert("hide_viewport", frame=frame)
        skin.hide_viewport = skin.hide_viewport or way == "disabled"
        make_live(rig, strands)
        found.append([points_at(strands, frame) for frame in (9, 20)])
        assert not messages(), messages()
        assert len(bpy.data.objects) == 3
    for shown, keyed, disabled in zip(*found, strict=True):
        assert max(apart(keyed, shown), apart(disabled, shown)) < SAME


def bodies_in_renders(_folder: Path) -> None:
    """Hair is kept out of the meshes that renders draw in any frame, whichever is shown; the motion is out of date when a body, or
    its collection, is hidden in renders.
    """
    rig, scene = scenes.armature(), bpy.context.scene
    scenes.dance(rig)
    scenes.body(rig)
    helmet, strands = scenes.body(rig), scenes.hair(rig, 5)
    helmet.name, hats = "Helmet", bpy.data.collections.new("Hats")
    scene.collection.children.link(hats)
    hats.objects.link(helmet)
    scene.collection.objects.unlink(helmet)
    layer = bpy.context.view_layer.layer_collection.children["Hats"]
    make_live(rig, strands)

    def bodies() -> tuple[str, ...]:
        notice(rig, scene)
        known = session.rigs["Rig"]
        found = ensure(bpy.context, rig)
        assert known.stale == (found is not known) == (found.bodies != known.bodies)
        return found.bodies

    assert bodies() == ("Body", "Helmet")
    for holder, setting in ((helmet, "hide_render"), (hats, "hide_render"), (layer, "exclude")):
        for hidden, expected in ((True, ("Body",)), (False, ("Body", "Helmet"))):
            setattr(holder, setting, hidden)
            assert bodies() == expected, setting
    for frame, hidden in ((1, True), (12, False)):
        helmet.hide_render = hidden
        helmet.keyframe_insert("hide_render", frame=frame)
    for frame, other in ((3, 20), (20, 3)):
        scene.frame_set(frame)
        assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
        scene.frame_set(other)
        assert bodies() == ("Body", "Helmet"), frame
    layer.exclude = True
    assert bodies() == ("Body",)


def _baked(out: Path, hang, hide) -> dict:
    """Points by frame of hair that is attached and hidden in some way."""
    scenes.empty()
    rig, strands = scenes.dancer(20)
    bpy.context.scene.frame_end = 12
    hang(rig, strands)
    bpy.context.scene.frame_set(7)
    hide(strands)
    bpy.context.scene.neuralocks.armature = rig
    make_live(rig, strands)
    strands.neuralocks_hair.live = False
    assert bpy.ops.neuralocks.bake(filepath=str(out)) == {"FINISHED"}
    return {frame: baked_points(out, "/Character/Hair_Hair", frame) for frame in (1, 9, 12)}


def _child_of(rig, strands) -> None:
    strands.parent = None
    held = strands.constraints.new("CHILD_OF")
    held.target, held.subtarget = rig, "head"


def _keyed(_rig, strands) -> None:
    for frame in (1, 12, 24):
        strands.location = (0, 0.1 if frame == 12 else 0, 0)
        strands.keyframe_insert("location", frame=frame)


def _vertex(rig, strands) -> None:
    strands.parent = scenes.body(rig)
    strands.parent_type = "VERTEX"


def _on_bone(rig, strands) -> None:
    head = rig.data.bones["head"]
    strands.parent, strands.parent_type, strands.parent_bone = rig, "BONE", head.name
    tail = head.matrix_local @ scenes.translation((0, head.length, 0))  # from where Blender counts
    strands.matrix_parent_inverse = tail.inverted()


def _on_relative_bone(rig, strands) -> None:
    rig.data.bones["head"].use_relative_parent = True
    strands.parent, strands.parent_type, strands.parent_bone = rig, "BONE", "head"


def _below_keyed(rig, strands) -> None:
    carrier = bpy.data.objects.new("Carrier", None)
    bpy.context.scene.collection.objects.link(carrier)
    carrier.parent, strands.parent = rig, carrier
    _keyed(rig, carrier)


def _disable(strands) -> None:
    strands.hide_viewport = True
    if strands.parent is not None and strands.parent.type == "EMPTY":
        strands.parent.hide_viewport = True


def _disable_unseen(strands) -> None:
    """Also by the eye of the outliner, which alone would leave it evaluated."""
    strands.hide_set(True)
    _disable(strands)


def _exclude(strands) -> None:
    scene = bpy.context.scene
    own = bpy.data.collections.new("Hair")
    scene.collection.children.link(own)
    own.objects.link(strands)
    scene.collection.objects.unlink(strands)
    bpy.context.view_layer.layer_collection.children["Hair"].exclude = True
