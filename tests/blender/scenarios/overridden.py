# SPDX-License-Identifier: GPL-3.0-or-later
"""A shot with a library override of a character whose own file has a bake already: what is done to it there lasts."""

from pathlib import Path

import bpy
import numpy as np

import dcc_addon
from dcc_addon.scene.baked.attach import has_cache
from tests.blender import scenes
from tests.blender.checks import (
    SAME,
    apart,
    baked_points,
    bones_at,
    give_bone_model,
    make_live,
    messages,
    needs_usd,
    points_at,
    refused,
)

TRACKS = ["Neuralocks Before Hair", "Neuralocks Hair"]
FRAMES = 1001, 1010, 1020


def keyed_in_a_shot(folder: Path) -> None:
    """Hair keys baked in a shot with its own animation play after it is reopened; those of the library are muted, and stay so when
    the shot's are removed.
    """
    rig = _keyed_library(folder)
    assert [track.name for track in rig.animation_data.nla_tracks] == TRACKS
    rig = _overridden(folder)
    of_library = _turns(rig)
    rig.animation_data.action = None
    scenes.dance(rig, (1001, 1024))
    own = rig.neuralocks_character
    own.rig_live = True
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    live = _turns(rig)
    assert apart(live, of_library) > 0.1 and not messages(), messages()
    for _ in range(2):  # a second bake takes the place of the first
        assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
        assert apart(_turns(rig), live) < SAME
        rig = _opened_again(folder)
        assert apart(_turns(rig), live) < SAME
        tracks = rig.animation_data.nla_tracks
        assert [track.mute for track in tracks] == [True, True, False, False], [*tracks]
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    rig.neuralocks_character.rig_live = True
    assert apart(_turns(rig), live) < SAME and not messages(), messages()
    rig.neuralocks_character.rig_live = False
    assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"}
    still = _turns(rig)
    assert apart(still, live) > 0.01
    rig = _opened_again(folder)
    assert [(track.name, track.mute) for track in rig.animation_data.nla_tracks] == [(name, True) for name in TRACKS]
    assert apart(_turns(rig), still) < 1e-6 and rig.pose.bones["hair.01"].rotation_mode == "XYZ"
    refused(bpy.ops.neuralocks.remove_keys, "no baked hair keys")


def keys_of_a_library(folder: Path) -> None:
    """Hair keys from the library are muted if they cannot be removed, until the character is local; a solo there, which Blender
    brings back, is refused.
    """
    _keyed_library(folder)
    rig = _overridden(folder)
    keyed = _turns(rig)
    assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"}
    rig = _opened_again(folder)
    tracks = rig.animation_data.nla_tracks
    assert [(track.name, track.mute) for track in tracks] == [(name, True) for name in TRACKS]
    assert apart(_turns(rig), keyed) > 0.01
    refused(bpy.ops.neuralocks.remove_keys, "no baked hair keys")
    if bpy.app.version >= (4, 0):  # older ones leave it an override
        tracks[0].mute = False
        rig.make_local(clear_liboverride=True)
        assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"} and not rig.animation_data.nla_tracks

    bpy.ops.wm.open_mainfile(filepath=str(folder / "library.blend"))
    bpy.data.objects["Rig"].animation_data.nla_tracks[TRACKS[1]].is_solo = True
    bpy.ops.wm.save_mainfile()
    rig = _overridden(folder)
    for operator in (bpy.ops.neuralocks.bake_keys, bpy.ops.neuralocks.remove_keys):
        refused(operator, "Neuralocks Hair", "library.blend", "star")
    assert not any(track.mute for track in rig.animation_data.nla_tracks)


def set_in_a_shot(folder: Path) -> None:
    """What is chosen for an override of a character whose library knows nothing of this add-on lasts when the shot is opened again, also
    if no view layer shows it, when the library is loaded again, and when the override is resynchronised.
    """
    dcc_addon.unregister()
    scenes.armature()
    scenes.collect("Character")
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "library.blend"))
    dcc_addon.register()
    scenes.empty()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    with bpy.data.libraries.load(str(folder / "library.blend"), link=True) as (_, wanted):
        wanted.collections = ["Character"]
    bpy.data.collections["Character"].override_hierarchy_create(
        bpy.context.scene, bpy.context.view_layer, do_fully_editable=True
    )
    for shown in (False, True):
        for part in bpy.context.view_layer.layer_collection.children:
            part.exclude = not shown
        own = _own("ARMATURE").neuralocks_character
        own.head_bone, own.wind = "head", 3.0 + shown
        own = _opened_again(folder).neuralocks_character
        assert (own.head_bone, own.wind) == ("head", 3.0 + shown), shown
    for reloaded in (False, True) if bpy.app.version >= (4, 0) else ():  # older ones have no such call
        if reloaded:
            bpy.data.libraries[0].reload()
            bpy.context.view_layer.update()
        root = _own("ARMATURE").override_library.hierarchy_root
        root.override_library.resync(bpy.context.scene, view_layer=bpy.context.view_layer)
        own = _own("ARMATURE").neuralocks_character
        assert (own.head_bone, own.wind) == ("head", 4.0), reloaded


def cached_in_a_shot(folder: Path) -> None:
    """A cache that hair has from its library, removed in a shot, stays off when the shot is reopened, as does one that the shot
    gave the hair instead, from a file of the same name; what moves the hair without it is on.
    """
    needs_usd()
    rig, strands = scenes.dancer(20)
    deform, blur = scenes.surface_deform(strands).name, "Neuralocks Cache Blur"
    strands.data.attributes.new("velocity", "FLOAT_VECTOR", "POINT")
    make_live(rig, strands)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "library.blend"))
    assert bpy.ops.neuralocks.bake_attach(filepath="//library.usdc") == {"FINISHED"}
    scenes.collect("Character")
    bpy.ops.wm.save_mainfile()
    rig = _overridden(folder)
    rig.animation_data.action = None
    scenes.dance(rig, (1001, 1024))
    scene, strands = bpy.context.scene, _own("CURVES")
    scene.neuralocks.hair = strands

    def on(strands) -> dict:
        return {m.name: m.show_viewport and m.show_render for m in strands.modifiers}

    assert on(strands) == {blur: True, "Neuralocks Cache": True, deform: False}
    for file in ("library", "shot"):
        cached = points_at(strands, 1010)
        assert bpy.ops.neuralocks.detach() == {"FINISHED"}
        still = points_at(strands, 1010)
        assert apart(still, cached) > 0.001, file
        _opened_again(folder)
        strands = _own("CURVES")
        assert on(strands) == {blur: False, "Neuralocks Cache": False, deform: True} and not has_cache(strands), file
        assert [cache.name_full.partition(" ")[0] for cache in bpy.data.cache_files] == ["library.usdc"]
        assert apart(points_at(strands, 1010), still) < 1e-6, file
        if file == "library":
            assert bpy.ops.neuralocks.bake_attach(filepath="//shot/library.usdc") == {"FINISHED"}
            cached = points_at(strands, 1010)
            _opened_again(folder)
            strands = _own("CURVES")
            assert on(strands) == {blur: True, "Neuralocks Cache": True, deform: False}
            assert apart(points_at(strands, 1010), cached) < 1e-6
            assert apart(cached, baked_points(folder / "shot" / "library.usdc", "/Character/Hair_Hair", 1010)) < SAME


def _keyed_library(folder: Path):
    """A file with a character whose hair keys are baked at frames 1 to 24."""
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig)
    give_bone_model(rig, folder)
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    scenes.collect("Character")
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "library.blend"))
    return rig


def _overridden(folder: Path):
    """The armature of that character in a saved shot of frames 1001 to 1024."""
    scenes.empty()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    with bpy.data.libraries.load(str(folder / "library.blend"), link=True) as (_, wanted):
        wanted.collections = ["Character"]
    scene, character = bpy.context.scene, bpy.data.collections["Character"]
    scene.collection.children.link(character)
    character.override_hierarchy_create(scene, bpy.context.view_layer, do_fully_editable=True)
    scene.frame_start, scene.frame_end = 1001, 1024
    scene.neuralocks.armature = _own("ARMATURE")
    return _own("ARMATURE")


def _opened_again(folder: Path):
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    return _own("ARMATURE")


def _own(kind: str):
    """The object of this kind that is not linked."""
    return next(thing for thing in bpy.data.objects if thing.type == kind and thing.library is None)


def _turns(rig) -> np.ndarray:
    """Matrices (T, 2, 4, 4) of the hair bones at FRAMES, as they are shown."""
    return np.array([bones_at(rig, frame, ("hair.01", "hair.02")) for frame in FRAMES])
