# SPDX-License-Identifier: GPL-3.0-or-later
"""Where bakes of several characters, and of several hair objects, go that have one output: none takes another's file."""

from pathlib import Path

import bpy

from tests.blender import scenes
from tests.blender.checks import MODEL, SAME, apart, baked_points, make_live, needs_usd, points_at


def one_output(folder: Path) -> None:
    """The bake of a second character gets its own file, and overwrites that the next time; so does its rig's."""
    scene, made, hairs = bpy.context.scene, {}, {}
    scene.neuralocks.output = str(folder / "out.usdc")
    for name, aside in (("Rig", 0), ("Bob.001", 2)):
        rig = scenes.armature(name, scenes.BONES + scenes.TAIL)
        scenes.dance(rig)
        rig.delta_location.x = aside
        hairs[name] = scenes.hair(rig, 10, name=f"{name}'s")
        make_live(rig, hairs[name])
        rig.neuralocks_character.rig_model = str(scenes.rig_model(rig, folder / f"{name}.neuralocks"))
    for _ in range(2):
        for name, hair in hairs.items():
            scene.neuralocks.armature = bpy.data.objects[name]
            assert bpy.ops.neuralocks.bake() == {"FINISHED"}
            assert bpy.ops.neuralocks.export_skel() == {"FINISHED"}
            made[name] = hair
    written = {path.name for path in folder.glob("*.usdc")}
    stems = ("out", "out_rig", "out_Bob_001", "out_rig_Bob_001")
    assert written == {f"{stem}{part}.usdc" for stem in stems for part in ("", "_shot")}, written
    for file, name, prim in (("out", "Rig", "Hair_Rig_s"), ("out_Bob_001", "Bob.001", "Hair_Bob_001_s")):
        baked = baked_points(folder / f"{file}.usdc", f"/Character/{prim}", 9)
        assert apart(baked, points_at(hairs[name], 9)) < SAME


def several_scenes(folder: Path) -> None:
    """Of versions of a scene that have one output, each goes on playing its own hair, also if its file was renamed; a bake that none
    plays is replaced by the next, and a renamed character's own, too. If no output is chosen, each scene's has its name.
    """
    needs_usd()
    rig = scenes.armature()
    bpy.context.scene.neuralocks.output, bpy.context.scene.frame_end = "//one.usdc", 12
    scenes.dance(rig)
    hair = scenes.hair(rig, 8)
    files, shown = {}, {}
    for version, twist in (("v001", 0.0), ("v002", 0.5), ("v003", 1.0)):
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / f"{version}.blend"))
        rig, hair = bpy.data.objects["Rig"], bpy.data.objects["Hair"]
        rig.pose.bones["head"].rotation_mode = "XYZ"
        hair.neuralocks_hair.motion = 1.0 - 0.5 * twist
        make_live(rig, hair)
        assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"}
        files[version] = hair.modifiers["Neuralocks Cache"].cache_file.filepath
        shown[version] = points_at(hair, 9)
        bpy.ops.wm.save_mainfile()
    assert len(set(files.values())) == 3 and apart(shown["v001"], shown["v003"]) > 100 * SAME
    assert files["v002"] == "//one_Hair.usdc", files
    for version, points in shown.items():
        bpy.ops.wm.open_mainfile(filepath=str(folder / f"{version}.blend"))
        assert apart(points_at(bpy.data.objects["Hair"], 9), points) < SAME, version

    rig, hair = bpy.data.objects["Rig"], bpy.data.objects["Hair"]
    rig.name = "Hero"
    hair.neuralocks_hair.motion = 1.0
    assert bpy.ops.neuralocks.bake(filepath=files["v003"]) == {"FINISHED"}
    assert apart(points_at(hair, 9), shown["v001"]) < SAME
    written = {path.name for path in folder.iterdir()}
    rig.name = "Rig"
    (folder / "v001.blend").rename(folder / "final.blend")
    for _ in range(2):
        assert bpy.ops.neuralocks.bake() == {"FINISHED"}
    bpy.context.scene.neuralocks.output = ""
    assert bpy.ops.neuralocks.bake() == {"FINISHED"}
    added = {path.name for path in folder.iterdir()} - written - {"final.blend"}
    assert added == {f"{stem}{end}.usdc" for stem in ("one_Rig", "v003_hair") for end in ("", "_shot")}, added
    bpy.ops.wm.open_mainfile(filepath=str(folder / "final.blend"))
    assert apart(points_at(bpy.data.objects["Hair"], 9), shown["v001"]) < SAME
    bpy.data.objects["Hair"].neuralocks_hair.motion = 0.5
    assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"}
    assert bpy.data.objects["Hair"].modifiers["Neuralocks Cache"].cache_file.filepath == files["v001"]


def like_names(folder: Path) -> None:
    """Hair objects whose plain names would be the same each play their own file, also when they are baked again."""
    needs_usd()
    rig, scene = scenes.armature(), bpy.context.scene
    scenes.dance(rig)
    hairs = [scenes.hair(rig, 8, name=name) for name in ("前髪", "横髪", "後髪", "Hair.L", "Hair_L", "Hair L")]
    scene.frame_end = 3
    scene.neuralocks.output = str(folder / "out.usdc")
    for hair in hairs:
        hair.neuralocks_hair.model = MODEL
    files = []
    for hair in (*hairs, *hairs):
        make_live(rig, hair)
        assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"}, hair.name
        files.append(hair.modifiers["Neuralocks Cache"].cache_file.filepath)
    assert len(set(files[:6])) == 6 and files[6:] == files[:6], files
    assert {Path(file).stem for file in files} == {
        "out",
        "out_横髪",
        "out_後髪",
        "out_Hair_L",
        "out_Hair_L_2",
        "out_Hair_L_3",
    }
