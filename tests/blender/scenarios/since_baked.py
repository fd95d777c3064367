# SPDX-License-Identifier: GPL-3.0-or-later
"""What was changed since hair was baked: the panel says so where a cache, or keys, show the old."""

from pathlib import Path

import bpy
from mathutils import Matrix

from tests.blender import scenes
from tests.blender.checks import SAME, apart, choose, give_bone_model, make_live, needs_usd, points_at
from tests.blender.panel import drawn, told_changed


def retimed_since(folder: Path) -> None:
    """If the frame rate or time stretching changes after hair was attached, a note says so, with the remedy, which makes the hair equal to live hair.
    Until then, the cache stays in step with the body, plays the old motion, and stands still where that ends.
    """
    needs_usd()
    rig, strands = scenes.dancer(20)
    scene = bpy.context.scene
    make_live(rig, strands)
    scene.frame_set(1)  # where the rig was not posed yet
    scene.neuralocks.output = str(folder / "hair.usdc")

    def told() -> bool:
        said = " ".join(drawn())
        found = "Hair: the frame rate or Time Stretching was" in said
        assert found == ("press Bake and Attach again" in said), said
        return found

    attached_once = False
    for rate, old, new in ((24, 100, 100), (24, 100, 200), (24, 100, 100), (60, 100, 100)):
        scene.render.fps, scene.render.frame_map_old, scene.render.frame_map_new = rate, old, new
        assert told() == attached_once
        assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"}
        attached_once = True
        assert not told()
        attached = points_at(strands, 20)
        strands.neuralocks_hair.live = True
        assert apart(points_at(strands, 20), attached) < SAME
        strands.neuralocks_hair.live = False
        scene.render.frame_map_old, scene.render.frame_map_new = 2 * old, 2 * new
        assert not told(), "the same stretch in other numbers"
    for rate, base, changed in ((120, 2.0, False), (120, 1.0, True), (60, 1.0, False)):
        scene.render.fps, scene.render.fps_base = rate, base
        assert told() == changed, (rate, base)
    scene.render.fps, scene.render.frame_map_new = 30, 50
    assert told()
    assert bpy.ops.neuralocks.bake(filepath=scene.neuralocks.output) == {"FINISHED"}
    assert not told(), "what it plays was baked anew"
    attached = points_at(strands, 20)
    strands.neuralocks_hair.live = True
    assert apart(points_at(strands, 20), attached) < SAME
    scene.render.fps = 24
    strands.neuralocks_hair.live = False
    assert told()
    assert bpy.ops.neuralocks.detach() == {"FINISHED"} and not told()


def changed_since(folder: Path) -> None:
    """If the animation changes after hair was attached, or its bones were keyed, a note says so in each frame in which the head is
    elsewhere, also when the file is opened again, until the hair is baked anew; another one says which frames were not baked.
    """
    from dcc_addon.session import session

    needs_usd()
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig)
    scenes.body(rig)
    strands = scenes.hair(rig, 20)
    strands.neuralocks_hair.armature = rig
    give_bone_model(rig, folder)
    operators, scene, name = bpy.ops.neuralocks, bpy.context.scene, rig.name
    scene.neuralocks.armature, scene.neuralocks.hair = rig, strands
    scene.neuralocks.output = str(folder / "hair.usdc")
    scene.frame_start, scene.frame_end = 1, 24
    neither, both = [False, False], [True, True]

    def told(*frames, wanted="the head is not where it was") -> list:
        found = []
        for frame in frames:
            bpy.context.scene.frame_set(int(frame), subframe=frame % 1)
            said = " ".join(drawn())
            found.append([f"press {name} again" in said for name in ("Bake and Attach", "Bake to Keyframes")])
            assert said.count(wanted) == sum(found[-1]), said
        return found

    def turn_head(frame: int = 10):
        bpy.context.scene.frame_set(frame)
        head = bpy.data.objects[name].pose.bones["head"]
        head.rotation_euler[1] += 0.05
        head.keyframe_insert("rotation_euler", frame=frame)

    assert operators.bake_attach() == operators.bake_keys() == {"FINISHED"}
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    for _ in range(2):
        assert told(1, 10, 10.5, 24, 30) == [neither] * 5
        bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    turn_head()
    assert told(1, 10, 10.5, 24) == [neither, both, neither, neither]
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    assert told(10, 24) == [both, neither]
    rig = bpy.data.objects[name]
    rig.hide_set(True)  # Blender poses it on for its body
    assert told(10, 24) == [both, neither]
    for hidden in (True, False):
        for thing in bpy.data.objects:
            thing.hide_viewport = hidden
        assert told(10) == [neither if hidden else both], "nothing poses it if all is hidden"
    assert operators.bake_attach() == {"FINISHED"} and told(10) == [[False, True]]
    bpy.ops.wm.save_mainfile()
    assert operators.bake_keys() == {"FINISHED"} and told(10) == [neither]
    turn_head()
    assert told(10) == [both] and operators.bake_attach() == {"FINISHED"}
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))  # Revert
    assert told(10) == [both], "the file on disk is the bake that was taken back"
    session.baked.clear()  # as if Blender had been closed meanwhile
    bpy.context.scene.frame_set(24)
    assert "its file was baked anew after this Blender file was saved, " in " ".join(drawn())
    assert operators.bake_attach() == operators.bake_keys() == {"FINISHED"} and told(10) == [neither]
    scene = bpy.context.scene
    scene.frame_end = 40
    assert told(24, 30, 40, 41, wanted="frames 1 to 24 were baked") == [neither, both, both, neither]
    scene.render.fps = 2 * scene.render.fps
    assert told(10, wanted="the frame rate or Time Stretching was changed") == [both]
    scene.render.fps = scene.render.fps // 2
    turn_head(30)
    scene.neuralocks.use_scene_range, scene.neuralocks.frame_start, scene.neuralocks.frame_end = False, 8, 12
    assert operators.bake_attach() == operators.bake_keys() == {"FINISHED"}
    assert told(7, 9, 30, wanted="frames 8 to 12 were baked") == [both, neither, both]
    assert operators.detach() == operators.remove_keys() == {"FINISHED"} and told(9, 30) == [neither] * 2


def groomed_since(folder: Path) -> None:
    """If attached hair is combed, moved, given other sliders or blown by another wind, a note says what the cache does not show, also
    when the file is opened again, until the hair is baked anew, or is live.
    """
    needs_usd()
    rig, strands = scenes.dancer(20, skinned=True)
    operators, scene = bpy.ops.neuralocks, bpy.context.scene
    scene.frame_end = 6
    make_live(rig, strands)
    scene.neuralocks.armature, scene.neuralocks.hair = rig, strands
    scene.neuralocks.output = str(folder / "hair.usdc")

    def comb(hair) -> None:
        hair.data.points[100].position.x += 0.01

    def push(hair) -> None:
        hair.location.x += 0.05

    def stiffen(hair) -> None:
        hair.neuralocks_hair.bend = 2.0

    def blow(hair) -> None:
        hair.neuralocks_hair.armature.neuralocks_character.wind = 3.0

    for edit, what in ((comb, "groom"), (push, "place"), (stiffen, "sliders"), (blow, "wind")):
        assert operators.bake_attach() == {"FINISHED"} and not told_changed()
        edit(bpy.data.objects["Hair"])
        assert told_changed() == [what]
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
        bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
        assert told_changed() == [what]
    hair = bpy.data.objects["Hair"]
    assert operators.bake_attach() == {"FINISHED"} and not told_changed()
    hair.parent.name = hair.name = "Another"
    assert not told_changed(), "a name is no place"
    choose(hair)
    bpy.ops.object.duplicate()
    bpy.context.scene.neuralocks.hair = bpy.context.object
    assert bpy.context.object != hair and not told_changed()
    bpy.data.objects.remove(bpy.context.object)
    bpy.context.scene.neuralocks.hair = hair
    hair.neuralocks_hair.armature.neuralocks_character.wind = 2.0
    assert told_changed() == ["wind"]
    hair.neuralocks_hair.live = True
    assert not told_changed()
    hair.neuralocks_hair.live = False
    assert told_changed() == ["wind"]
    hair["neuralocks_groomed"] = 7
    assert not told_changed()
    assert operators.detach() == {"FINISHED"} and "neuralocks_groomed" not in hair


def changed_since_in_centimetres(folder: Path) -> None:
    """An armature of a hundredth of its bones' size turns as far as any other."""
    needs_usd()
    rig, strands = scenes.dancer(20)
    rig.data.transform(Matrix.Scale(100, 4))
    rig.scale = [0.01] * 3
    make_live(rig, strands)
    scene = bpy.context.scene
    scene.neuralocks.output = str(folder / "hair.usdc")
    assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"}
    said = []
    for turned in (0, 0.02):
        scene.frame_set(10)
        rig.pose.bones["head"].rotation_euler[1] += turned
        rig.pose.bones["head"].keyframe_insert("rotation_euler", frame=10)
        scene.frame_set(10)
        said.append("the head is not where it was" in " ".join(drawn()))
    assert said == [False, True]
