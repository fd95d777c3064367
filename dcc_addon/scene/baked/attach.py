# SPDX-License-Identifier: GPL-3.0-or-later
"""A baked cache on a hair object: Blender's own modifier plays it, on any machine, without this add-on."""

import os
from fractions import Fraction

import bpy

from neuralocks_core.errors import NeuralocksError

from ...session import session
from ..files.paths import check_own, full
from ..files.save_as import named_here
from ..hair import blur, cached_strands
from ..hair.muting import CACHE as MODIFIER
from ..hair.muting import caches_of_others, mute_deformers, off_meanwhile, unmute_deformers
from . import groom_record, motion_record
from .rewritten_caches import read_again

REPLACED = "replaced"
"""The setting that stores which modifiers are off because the cache contains the surface's motion."""


def check_possible(hair) -> None:
    """Refuse a Blender that was built without USD, and hair of another file."""
    check_own(hair)
    if not getattr(bpy.app.build_options, "usd", True):
        raise NeuralocksError(
            "Bake and Attach: this Blender is built without USD; use Bake to USD, or Blender from blender.org"
        )


def has_cache(thing) -> bool:
    """Whether a cache is on an object; one from the file of an overridden object is removed by switching it off."""
    modifier = thing.modifiers.get(MODIFIER)
    if modifier is None:
        return False
    shown = modifier.show_viewport or modifier.show_render or MODIFIER in off_meanwhile(thing)
    return shown or _original(thing, modifier) is None


def changed_since(thing, scene) -> str:
    """What was changed since the cache of an object was baked, and shows in this frame, with the remedy; empty if nothing is known to be.
    If Blender took a bake back, by an undo or by opening the file again, its file on disk is still that of the last one.
    """
    cache = thing.modifiers[MODIFIER].cache_file if has_cache(thing) else None
    if cache is None:
        return ""
    path = _place(cache)
    told = session.baked.get(path, cache.get(motion_record.KEY))
    return motion_record.changed(told, thing.neuralocks_hair.armature, scene, "Bake and Attach", path)


def players(path: str) -> list:
    """Hair objects that play the USD file `path`."""
    return [
        thing
        for thing in bpy.data.objects
        if has_cache(thing) and (cache := thing.modifiers[MODIFIER].cache_file) and _is(cache, path)
    ]


def is_imported(path: str) -> bool:
    """Whether something in this file was imported from the USD file `path`, and still plays it: not the add-on's own caches."""
    for thing in bpy.data.objects:
        found = [*caches_of_others(thing), *(c for c in thing.constraints if c.type == "TRANSFORM_CACHE")]
        if any(each.cache_file is not None and _is(each.cache_file, path) for each in found):
            return True
    return False


def renew(path: str, prims: dict[str, str], scene, frames: tuple[int, int]) -> None:
    """Show what has just been written of these frames, first and last, to the USD file `path` on the hair that plays it: its prim of
    `prims`, by its name.
    """
    playing = players(path)
    # A cache that is off still holds the strands of before, until it is removed.
    other = [hair for hair in playing if cached_strands.is_off(hair.data)]
    playing = [hair for hair in playing if hair not in other]
    for hair in playing:
        modifier = hair.modifiers[MODIFIER]
        prim = prims.get(hair.name_full, modifier.object_path)
        if modifier.object_path != prim:
            modifier.object_path = prim
        blur.attach(hair)
        _remember(hair, modifier.cache_file, scene, frames)
    caches = {hair.modifiers[MODIFIER].cache_file for hair in playing}
    for cache in caches:
        _follow_time(cache, scene)
    if caches:
        read_again(caches)
    for hair in other:
        if hair.name_full in prims:
            attach(hair, path, prims[hair.name_full], scene, frames)


def attach(hair, path: str, prim: str, scene, frames: tuple[int, int]) -> None:
    """Let the hair play the groom `prim` of the USD file `path`, whose time codes are frames of this scene, from first to last."""
    detach(hair)
    mute_deformers(hair, REPLACED)
    cache = _cache_file(path)
    read_again([cache])
    cache.scale = 1.0
    _follow_time(cache, scene)
    _remember(hair, cache, scene, frames)
    modifier = hair.modifiers.get(MODIFIER) or hair.modifiers.new(MODIFIER, "MESH_SEQUENCE_CACHE")
    modifier.show_viewport = modifier.show_render = True
    modifier.cache_file = cache
    modifier.object_path = prim
    if len(hair.modifiers) > 1 and _original(hair, modifier) is None:
        if hasattr(hair.modifiers, "move"):
            hair.modifiers.move(hair.modifiers.find(MODIFIER), 0)
    cached_strands.remember(hair.data)
    blur.attach(hair)


def switch_changed() -> None:
    """Switch caches off whose hair has other strands now, before Blender evaluates them, and on again if these come back."""
    for data, on in cached_strands.to_switch():
        for thing in bpy.data.objects:
            if thing.data == data and has_cache(thing):
                modifier = thing.modifiers[MODIFIER]
                modifier.show_viewport = modifier.show_render = on


def detach(hair) -> bool:
    """Remove the cache, and let the hair follow its surface as before; returns whether there was one."""
    blur.detach(hair)
    groom_record.forget(hair)
    if not has_cache(hair):  # it may have been removed by hand
        unmute_deformers(hair, REPLACED)
        return False
    # Another object with the same curves may play its cache on.
    if not any(other.data == hair.data and other != hair and has_cache(other) for other in bpy.data.objects):
        cached_strands.forget(hair.data)
    modifier = hair.modifiers[MODIFIER]
    cache, original = modifier.cache_file, _original(hair, modifier)
    if original is None:
        hair.modifiers.remove(modifier)
    else:  # Blender would bring it back when this file is opened again
        modifier.show_viewport = modifier.show_render = False
        modifier.cache_file, modifier.object_path = original.cache_file, original.object_path
    if cache is not None and not cache.users:
        bpy.data.batch_remove([cache])  # cache files have no remove of their own
    unmute_deformers(hair, REPLACED)
    return True


def _original(thing, modifier):
    """The modifier that a modifier of an overridden object comes from; None for any other."""
    if thing.override_library is None or not modifier.is_override_data:
        return None
    return thing.override_library.reference.modifiers.get(modifier.name)


def _follow_time(cache, scene) -> None:
    """Play the baked frames even if time is stretched: everything animated, including caches, is then at another frame than the one
    shown.
    """
    stretch = Fraction(scene.render.frame_map_new, scene.render.frame_map_old)
    cache.driver_remove("frame")
    cache.override_frame = stretch != 1
    if stretch != 1:
        cache.driver_add("frame").driver.expression = f"frame * {stretch.numerator} / {stretch.denominator}"


def _cache_file(path: str):
    """The data block of a cache file; only the open operator makes one."""
    known = set(bpy.data.cache_files)  # one of a library may have the new one's name
    for cache in bpy.data.cache_files:
        if _is(cache, path):
            return cache
    bpy.ops.cachefile.open(filepath=path)
    cache = next(c for c in bpy.data.cache_files if c not in known)
    cache.user_clear()  # the operator counts a user that does not exist, and the block would outlast its modifiers
    cache.filepath = named_here(path)
    return cache


def _remember(hair, cache, scene, frames: tuple[int, int]) -> None:
    groom_record.remember(hair, scene)
    if hair.neuralocks_hair.armature is not None:
        path = _place(cache)
        session.baked[path] = motion_record.remember(cache, hair.neuralocks_hair.armature, scene, frames, path)


def _is(cache, path: str) -> bool:
    return _place(cache) == os.path.normcase(os.path.abspath(path))


def _place(cache) -> str:
    return os.path.normcase(os.path.abspath(full(cache.filepath, cache.library)))
