# SPDX-License-Identifier: GPL-3.0-or-later
"""Live hair that is given other strands, another model, or what an operator applies to its points."""

import shutil
from pathlib import Path
from unittest import SkipTest

import bpy
import numpy as np

from dcc_addon.scene.hair import curves
from dcc_addon.scene.hair.nodes import geometry_nodes
from neuralocks_core.models.model_file import shipped
from tests.blender import scenes
from tests.blender.checks import MODEL, SAME, apart, baked_points, choose, make_live, messages, points_at


def other_strands(folder: Path) -> None:
    """Live hair that gets other curves, or more or fewer strands, shows them at once, and its former curves get their rest shape
    back; live resumes when an editing mode is left.
    """
    from dcc_addon.operators.bake import bake_steps

    rig = scenes.armature()
    scenes.dance(rig)
    strands, other = scenes.hair(rig, 20), scenes.hair(rig, 20, length=0.15, name="Other")
    short, long = other.data, strands.data
    bpy.data.objects.remove(other)
    groomed = curves.points(long)
    make_live(rig, strands)
    shown = points_at(strands, 9)

    bpy.context.view_layer.objects.active = strands
    long.surface = scenes.body(rig)
    for mode in ("EDIT_CURVES" if bpy.app.version < (3, 5) else "EDIT", "SCULPT_CURVES"):
        if bpy.app.version < (3, 5) and mode == "EDIT_CURVES":
            continue  # no such mode yet
        bpy.ops.object.mode_set(mode=mode)
        bpy.context.view_layer.update()
        assert np.array_equal(curves.shown(long), groomed)
        bpy.ops.object.mode_set(mode="OBJECT")
        bpy.context.view_layer.update()
        assert apart(scenes.points(strands), shown) < 1e-6 or len(long.points) != len(groomed), mode

    strands.data = short
    bpy.context.view_layer.update()
    assert np.array_equal(curves.shown(long), groomed) and not curves.has_rest(long)
    if hasattr(short, "add_curves"):
        points_at(strands, 5)
        short.add_curves([24])
        end = np.float32([[0, 0.05, 1.7 - 0.01 * k] for k in range(24)])
        for name in ("position", curves.REST):
            values = np.concatenate([curves.points(short)[:-24], end])
            short.attributes[name].data.foreach_set("vector", values.ravel())
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    view = {frame: points_at(strands, frame) for frame in (4, 9)}
    for _ in (steps := _Returned(bake_steps(bpy.context, rig, [strands], str(folder / "out.usdc")))):
        pass
    for frame, seen in view.items():
        assert apart(seen, baked_points(*steps.value.hair["Hair"], frame)) < 1e-5, frame
    assert not messages(), messages()

    bpy.context.scene.collection.objects.unlink(strands)
    strands.use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "left.blend"))
    assert not curves.has_rest(short), "hair that is in no scene is saved at rest"


def separated(_folder: Path) -> None:
    """Blender's own Separate leaves both parts live, although it then counts a user too many; really shared curves are refused."""
    if "separate" not in dir(bpy.ops.curves):
        raise SkipTest("this Blender separates no strands")
    rig, strands = scenes.dancer(20)
    make_live(rig, strands)
    points_at(strands, 9)
    bpy.context.view_layer.objects.active = strands
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.curves.set_selection_domain(domain="CURVE")
    bpy.ops.curves.select_all(action="DESELECT")
    for index in range(5):
        strands.data.attributes[".selection"].data[index].value = True
    bpy.ops.curves.separate()
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.update()
    assert [len(data.curves) for data in bpy.data.hair_curves] == [15, 5]
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"} and not messages(), messages()
    for part in (thing for thing in bpy.data.objects if thing.type == "CURVES"):
        assert apart(points_at(part, 9), points_at(part, 1)) > 1e-3, part.name
    copy = strands.copy()
    bpy.context.scene.collection.objects.link(copy)
    bpy.context.view_layer.update()
    points_at(strands, 5)
    assert any("several objects share these curves" in text for text in messages().values()), messages()


def linked_data(_folder: Path) -> None:
    """Two live hairs are given the same curves, of either: both are told so and stay live, and move once they have their own."""
    for given in (0, 1):
        scenes.empty()
        rig = scenes.armature()
        scenes.dance(rig)
        hairs = [scenes.hair(rig, 20), scenes.hair(rig, 20, length=0.4, name="Wig")]
        for strands in hairs:
            make_live(rig, strands)
        rest, shown = curves.points(hairs[given].data), points_at(hairs[given], 9)
        bpy.ops.object.select_all(action="SELECT")
        bpy.context.view_layer.objects.active = hairs[given]
        bpy.ops.object.make_links_data(type="OBDATA")
        bpy.context.view_layer.update()
        assert hairs[0].data == hairs[1].data and all(strands.neuralocks_hair.live for strands in hairs), messages()
        for name in ("Hair", "Wig"):
            assert "several objects share these curves" in messages()[name], messages()
        assert np.array_equal(curves.shown(hairs[0].data), rest)
        bpy.ops.object.make_single_user(object=True, obdata=True)
        assert all(apart(points_at(strands, 9), shown) < SAME for strands in hairs) and not messages(), messages()


def replaced_model(folder: Path) -> None:
    """A rewritten model file, for example from another training, moves live hair from the next frame on, as it would a bake."""
    rig = scenes.armature()
    scenes.dance(rig)
    strands, model = scenes.hair(rig, 20), folder / "mine.neuralocks"
    shutil.copy(MODEL, model)
    make_live(rig, strands)
    strands.neuralocks_hair.model = str(model)
    before = points_at(strands, 9)
    new = folder / "new.neuralocks"
    shutil.copy(shipped("strands"), new)
    new.replace(model)
    after = points_at(strands, 9)
    strands.neuralocks_hair.model = ""
    assert apart(before, after) > 0.005 and apart(after, points_at(strands, 9)) == 0.0
    strands.neuralocks_hair.model = str(model)
    model.unlink()
    points_at(strands, 9)
    assert "mine.neuralocks" in messages()["Hair"], messages()


def applied(_folder: Path) -> None:
    """What is applied to the points of live hair is applied to its rest shape: as it would be with Live off, and nothing moves
    meanwhile. What cannot be applied is reported, and Live is off then.
    """

    def groomed(live: bool, change):
        """Rest points after `change`, in the world, and by how much live hair moved meanwhile."""
        scenes.empty()
        rig = scenes.armature()
        scenes.dance(rig)
        strands, scene = scenes.hair(rig, 20), bpy.context.scene
        strands.rotation_euler, strands.scale = (0.1, 0.3, 0.5), (1.4, 1.4, 1.4)
        before = points_at(strands, 9)
        if live:
            make_live(rig, strands)
            before = points_at(strands, 9)
        choose(strands)
        change(strands)
        bpy.context.view_layer.update()
        moved = apart(points_at(strands, 9), before) if len(strands.data.points) * 3 == before.size else None
        if live:
            assert strands.neuralocks_hair.live, messages()
            strands.neuralocks_hair.live = False
        scene.frame_set(1)
        return scenes.points(strands), moved

    def more(strands):
        scenes.hair(strands.parent, 10, name="More", length=0.1).select_set(True)
        bpy.ops.object.join()

    changes = [
        lambda _: bpy.ops.object.transform_apply(location=True, rotation=True, scale=True),
        lambda _: bpy.ops.object.origin_set(type="ORIGIN_GEOMETRY"),
    ]
    if bpy.app.version >= (5, 2):
        changes.append(more)
    for change in changes:
        off, _ = groomed(False, change)
        live, moved = groomed(True, change)
        assert apart(off, live) < 1e-6
        assert change is more or moved < 1e-5

    scenes.empty()
    rig, strands = scenes.dancer(20)
    groom = np.array([point.position for point in strands.data.points])
    tree, source, target = geometry_nodes("Frizz")
    offset = tree.nodes.new("GeometryNodeSetPosition")
    offset.inputs["Offset"].default_value = (0, 0.05, 0)
    tree.links.new(source, offset.inputs[0])
    tree.links.new(offset.outputs[0], target)
    strands.modifiers.new("Frizz", "NODES").node_group = tree
    make_live(rig, strands)
    points_at(strands, 9)
    choose(strands)
    bpy.ops.object.modifier_apply(modifier="Frizz")
    points_at(strands, 10)
    assert "'Frizz' was applied" in messages()["Hair"] and not strands.neuralocks_hair.live
    assert np.array_equal([point.position for point in strands.data.points], groom)


class _Returned:
    """Loops over a generator; `value` is what it returned."""

    def __init__(self, steps):
        self._steps, self.value = steps, None

    def __iter__(self):
        self.value = yield from self._steps
