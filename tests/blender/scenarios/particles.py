# SPDX-License-Identifier: GPL-3.0-or-later
"""Particle hair becomes Curves: as it was groomed, on what it grows on, and as it looks."""

from functools import partial
from pathlib import Path

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import SAME, apart, refused


def particles(_folder: Path) -> None:
    """Particle hair becomes Curves with all its keys, on the head."""
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.1, location=(0, 0, 1.6))
    ball = bpy.context.active_object
    ball.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = ball.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length, settings.hair_step = "HAIR", 40, 0.2, 7
    bpy.context.view_layer.update()
    assert bpy.ops.neuralocks.from_particles() == {"FINISHED"}
    strands = bpy.context.scene.neuralocks.hair
    assert len(strands.data.curves) == 40 and len(strands.data.points) == 40 * 8
    points = scenes.points(strands).reshape(40, 8, 3)
    away = np.linalg.norm(points - [0, 0, 1.6], axis=2)
    assert np.abs(away[:, 0] - 0.1).max() < 2e-3 and (away[:, -1] > 0.25).all()

    # Even in the middle of a rig's dance, the hair is converted as it is at rest.
    rig = scenes.armature()
    scenes.dance(rig, (-8, 24))
    skinned = bpy.data.objects.new("Skinned", ball.data.copy())
    bpy.context.scene.collection.objects.link(skinned)
    skinned.location, skinned.parent = ball.location, rig
    skinned.vertex_groups.new(name="head").add(range(len(ball.data.vertices)), 1.0, "REPLACE")
    skinned.modifiers.new("Armature", "ARMATURE").object = rig
    skinned.modifiers.new("Hair", "PARTICLE_SYSTEM").particle_system.settings = settings
    bpy.context.scene.frame_set(9)
    bpy.context.view_layer.objects.active = skinned
    assert bpy.ops.neuralocks.from_particles() == {"FINISHED"}
    found = bpy.context.scene.neuralocks.hair
    assert found.parent == skinned and rig.data.pose_position == "POSE"
    own, same = (np.array([p.position for p in hair.data.points]) for hair in (found, strands))
    assert apart(own, same) < SAME


def particle_systems(_folder: Path) -> None:
    """Several particle systems are converted one after the other, whole and with their children as rendered, however few of them
    the viewport shows; systems that emit no hair are skipped.
    """
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.1, location=(0, 0, 1.6))
    ball, scene, convert = bpy.context.active_object, bpy.context.scene, bpy.ops.neuralocks.from_particles
    ball.modifiers.new("Subdivision", "SUBSURF")
    for name in ("Dust", "Long", "Fringe"):
        ball.modifiers.new(name, "PARTICLE_SYSTEM")
        ball.particle_systems[-1].name = name
        settings = ball.particle_systems[-1].settings
        settings.count, settings.hair_length = 10, 0.2
        settings.type = "EMITTER" if name == "Dust" else "HAIR"
        settings.display_percentage = 20
    settings.child_type, settings.rendered_child_count, settings.display_percentage = "SIMPLE", 3, 50
    scene.render.use_simplify, scene.render.simplify_child_particles = True, 0.3
    ball.modifiers["Long"].show_viewport = False  # to work faster; it is rendered
    ball.particle_systems.active_index = 0
    bpy.context.view_layer.update()
    assert convert() == {"FINISHED"}
    assert scene.neuralocks.hair.name == "Long Hair" and len(scene.neuralocks.hair.data.curves) == 10
    keys = scenes.points(scene.neuralocks.hair).reshape(10, -1, 3)
    assert np.linalg.norm(keys[:, -1] - keys[:, 0], axis=1).min() > 0.1
    assert convert() == {"FINISHED"}
    found = scene.neuralocks.hair
    points = scenes.points(found)
    assert found.name == "Fringe Hair" and len(found.data.curves) == 10 + 30
    roots = points[[curve.points[0].index for curve in found.data.curves]]
    tips = points[[curve.points[len(curve.points) - 1].index for curve in found.data.curves]]
    assert 0.1 < np.linalg.norm(tips - roots, axis=1).min() and np.abs(points - [0, 0, 1.6]).max() < 0.6
    assert scene.render.simplify_child_particles == np.float32(0.3)
    assert settings.display_percentage == 50 and [m.show_render for m in ball.modifiers] == [True, True, False, False]
    refused(convert, "no object of this scene", "type Hair")
    refused(lambda: convert(system="Dust"), "emits particles")
    ball.scale.x = 0.0
    refused(partial(convert, system="Fringe"), "zero scale, so the children of 'Fringe' cannot be read")
    ball.scale.x = 1.0
    assert convert(system="Fringe", children=False) == {"FINISHED"} and len(scene.neuralocks.hair.data.curves) == 10


def cut_children(_folder: Path) -> None:
    """Children of which a threshold cuts many short have their points on themselves, whether parents are drawn or not; nothing else
    is left over, and what is selected stays so.
    """
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.1, location=(0.3, 0, 1.6), rotation=(0.3, 0.2, 1.0))
    ball, scene = bpy.context.active_object, bpy.context.scene
    ball.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = ball.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length = "HAIR", 20, 0.2
    settings.child_type, settings.rendered_child_count = "INTERPOLATED", 10
    settings.child_length, settings.child_length_threshold = 0.5, 0.4
    for drawn in (False, True):
        settings.use_parent_particles = ball.modifiers[0].show_viewport = drawn
        assert bpy.ops.neuralocks.from_particles(system=ball.particle_systems[0].name) == {"FINISHED"}
        hair = scene.neuralocks.hair
        assert len(hair.data.curves) == 20 + 20 * 10 and settings.use_parent_particles == drawn
        assert len(bpy.data.hair_curves) == len([t for t in scene.objects if t.type == "CURVES"]) == 1 + drawn
        counts = np.array([len(curve.points) for curve in hair.data.curves])[20:]
        assert len(set(counts)) > 1
        points = np.array([point.position for point in hair.data.points])
        assert 0.099 < np.linalg.norm(points, axis=1).min() and np.linalg.norm(points, axis=1).max() < 0.35
        objects = bpy.context.view_layer.objects  # Blender 3.4 forgets both when an object is added
        assert bpy.app.version < (4, 0) or (objects.active == ball and list(objects.selected) == [ball])


def particles_where_they_show(folder: Path) -> None:
    """Hair converted from particles is in the collections of its head, and shown if the head is; also on a head that is overridden,
    while a linked one is refused and keeps its particles.
    """
    scene = bpy.context.scene
    kept, own = bpy.data.collections.new("A"), bpy.data.collections.new("B")
    for each in (kept, own):
        scene.collection.children.link(each)
        each.objects.link(_ball())
    ball = own.objects[0]
    kept.objects.link(ball)
    bpy.context.view_layer.layer_collection.children["A"].exclude = True
    bpy.context.view_layer.objects.active = ball
    assert bpy.ops.neuralocks.from_particles() == {"FINISHED"}
    assert [each.name for each in scene.neuralocks.hair.users_collection] == ["A", "B"]

    ball.modifiers[0].show_viewport = ball.modifiers[0].show_render = True
    bpy.data.objects.remove(scene.neuralocks.hair)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "head.blend"))
    for overridden in (False, True):
        scenes.empty()
        scene, layer = bpy.context.scene, bpy.context.view_layer
        with bpy.data.libraries.load(str(folder / "head.blend"), link=True) as (_, wanted):
            wanted.collections = ["B"]
        (linked,) = wanted.collections
        scene.collection.children.link(linked)
        if overridden:
            linked.override_hierarchy_create(scene, layer)
            scene.collection.children.unlink(linked)
        layer.update()
        (ball,) = (thing for thing in scene.objects if thing.type == "MESH" and thing.visible_get())
        if overridden:
            assert bpy.ops.neuralocks.from_particles() == {"FINISHED"}
            assert scene.neuralocks.hair.name in layer.objects and len(scene.neuralocks.hair.data.curves) == 40
        else:
            refused(bpy.ops.neuralocks.from_particles, ball.name, "linked from head.blend")
            assert not bpy.data.hair_curves
        assert ball.modifiers[0].show_render != overridden


def particles_on_what_is_rendered(_folder: Path) -> None:
    """Particle hair grows on the surface that renders show, however coarse it is in the viewport."""
    ball = _ball("SUBSURF", "DISPLACE")
    bpy.context.scene.collection.objects.link(ball)
    bpy.context.view_layer.objects.active = ball
    subdivision, puff = ball.modifiers[:2]
    puff.strength = 0.01
    found = []
    for levels, drawn in ((0, False), (2, True)):
        subdivision.levels, subdivision.render_levels, puff.show_viewport = levels, 2, drawn
        assert bpy.ops.neuralocks.from_particles(system=ball.particle_systems[0].name) == {"FINISHED"}
        assert (subdivision.levels, puff.show_viewport) == (levels, drawn)
        found.append(np.array([p.position for p in bpy.context.scene.neuralocks.hair.data.points]))
    driver = subdivision.driver_add("levels").driver
    driver.expression = "0 * frame"
    bpy.context.scene.frame_set(2)
    assert bpy.ops.neuralocks.from_particles(system=ball.particle_systems[0].name) == {"FINISHED"}
    assert subdivision.levels == 0 and not ball.animation_data.drivers[0].mute
    found.append(np.array([p.position for p in bpy.context.scene.neuralocks.hair.data.points]))
    assert apart(found[0], found[1]) < SAME and apart(found[0], found[2]) < SAME


def _ball(*modifiers: str):
    """A small head with forty hairs on what these modifiers make of it, in no collection."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=12, ring_count=8, radius=0.1)
    ball = bpy.context.active_object
    for each in ball.users_collection:
        each.objects.unlink(ball)
    for kind in modifiers:
        ball.modifiers.new(kind, kind)
    ball.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = ball.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length = "HAIR", 40, 0.2
    return ball


def simulated_particles(_folder: Path) -> None:
    """Particle hair that its own simulation has moved is converted as it was groomed."""
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.1, location=(0, 0, 1.6))
    ball, scene = bpy.context.active_object, bpy.context.scene
    ball.modifiers.new("Hair", "PARTICLE_SYSTEM")
    system = ball.particle_systems[0]
    system.settings.type, system.settings.count, system.settings.hair_length = "HAIR", 10, 0.3
    found = []
    for simulated in (False, True):
        system.use_hair_dynamics = ball.modifiers[0].show_viewport = simulated
        for frame in range(1, 16):
            scene.frame_set(frame)
        assert bpy.ops.neuralocks.from_particles(system=system.name) == {"FINISHED"}
        assert system.use_hair_dynamics == simulated
        found.append(scenes.points(scene.neuralocks.hair))
    assert apart(*found) < SAME


def particles_under_shapes(_folder: Path) -> None:
    """Particle hair is the same groom whatever values its scalp's animated shape keys have in the frame; it lies on the shape of
    those that are always on, even if they are keyed so.
    """
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.1, location=(0, 0, 1.6))
    ball, scene = bpy.context.active_object, bpy.context.scene
    blocks = {
        name: ball.shape_key_add(name=name) for name in ("Basis", "Brow", "Sung", "Driven", "Tall", "Wide", "Off")
    }
    for name, axis in (("Brow", 2), ("Sung", 2), ("Driven", 2), ("Tall", 2), ("Wide", 1), ("Off", 1)):
        for point in blocks[name].data:
            point.co[axis] += 0.03
    for frame in (1, 10):
        blocks["Brow"].value, blocks["Sung"].value, blocks["Wide"].value = frame == 10, frame == 10, 1.0
        for name in ("Brow", "Sung", "Wide"):
            blocks[name].keyframe_insert("value", frame=frame)
    curves = scenes.fcurves(ball.data.shape_keys)
    next(c for c in curves if "Sung" in c.data_path).convert_to_samples(1, 10)  # as sound is baked
    blocks["Driven"].driver_add("value").driver.expression = "frame / 20"
    blocks["Tall"].value, blocks["Off"].mute = 1.0, True
    ball.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = ball.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length = "HAIR", 20, 0.2
    found = []
    for frame in (1, 10):
        scene.frame_set(frame)
        shown = [block.value for block in blocks.values()]
        assert bpy.ops.neuralocks.from_particles(system=ball.particle_systems[0].name) == {"FINISHED"}
        found.append(scenes.points(scene.neuralocks.hair).reshape(20, -1, 3))
        assert [name for name, block in blocks.items() if block.mute] == ["Off"]
        assert [block.value for block in blocks.values()] == shown
    assert apart(*found) < SAME
    away = np.linalg.norm(found[0][:, 0] - [0, 0.03, 1.63], axis=1)
    assert np.abs(away - 0.1).max() < 2e-3, away


def particle_looks(_folder: Path) -> None:
    """Converted hair has the material of its slot and is as thick as it was drawn; it belongs to the armature that moves what it
    grows on, whichever is shown, and is found with it.
    """
    scene, rig, other = bpy.context.scene, scenes.armature(), scenes.armature("Other")
    skin = scenes.body(rig)
    for name in ("Skin", "Strands"):
        skin.data.materials.append(bpy.data.materials.new(name))
    skin.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = skin.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length, settings.hair_step = "HAIR", 10, 0.3, 4
    settings.material, settings.use_close_tip = 2, False
    settings.root_radius, settings.tip_radius, settings.radius_scale, settings.shape = 1.0, 0.5, 0.004, 0.5
    scene.neuralocks.armature, bpy.context.view_layer.objects.active = other, skin
    assert bpy.ops.neuralocks.from_particles() == {"FINISHED"}
    found = scene.neuralocks.hair
    assert [material.name for material in found.data.materials] == ["Strands"]
    radius = np.array([value.value for value in found.data.attributes["radius"].data]).reshape(10, -1)
    expected = 0.001 + 0.001 * np.linspace(1, 0, radius.shape[1]) ** 2  # half of the diameters, 4 mm and 2 mm
    assert apart(radius, np.tile(expected, (10, 1))) < 1e-5
    assert found.neuralocks_hair.armature == rig

    scenes.hair(other, 3, name="A")
    for chosen, hair in ((rig, found.name), (other, "A"), (found, found.name)):
        for thing in scene.objects:
            thing.select_set(thing == chosen)
        assert bpy.ops.neuralocks.find() == {"FINISHED"} and scene.neuralocks.hair.name == hair
        assert scene.neuralocks.armature == (chosen if chosen.type == "ARMATURE" else rig)
