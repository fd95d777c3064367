# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses without keys: animators move several bones, or change a lamp, before they set a key. Stepping through frames,
which happens in the background, would overwrite them with the animation.
"""

import re

import bpy
import numpy as np

from ..objects.animated import animated

PLACE = {"location": 3, "rotation_quaternion": 4, "rotation_euler": 3, "rotation_axis_angle": 4, "scale": 3}
"""Channels of objects and of bones, and their sizes."""
_CHANNEL = re.compile(rf'(pose\.bones\["(\\.|[^"\\])*"\]\.)?({"|".join(PLACE)})')
"""Paths of these channels: other properties of such names, such as a modifier's scale, are stored separately."""


class Unkeyed:
    """Channels of all animated objects of a scene, and whatever else keys write, as they are now."""

    def __init__(self, scene):
        own = (thing for thing in scene.objects if thing.library is None)
        self._kept = {o.name_full: _channels(o) for o in own if _has_keys(o) or _has_keys(_keys(o))}
        self._others = [
            (kind, thing.name, within, path, value)
            for kind in _kinds()
            for thing in getattr(bpy.data, kind)
            if thing.library is None
            for within in (False, True)
            for path, value in _written(_owner(thing, within), kind == "objects")
        ]

    def put_back(self) -> None:
        """Restore the values that have changed since."""
        own = {kind: _own_of(kind) for kind in {"objects", *(kind for kind, *_ in self._others)}}
        for kind, name, within, path, value in self._others:
            owner = _owner(own[kind].get(name), within)
            if owner is not None and value_of(owner, path) not in (None, value):
                _write(owner, path, value)
        for name, kept in self._kept.items():
            thing = own["objects"].get(name)
            if thing is None:
                continue
            now = _channels(thing)
            changed = [key for key in kept if key in now and not np.array_equal(kept[key], now[key])]
            for key in changed:
                _set(thing, key, kept[key])
            if changed:
                thing.update_tag()
                if _keys(thing) is not None:
                    _keys(thing).update_tag()


def value_of(owner, path: str):
    """Number, text or list of numbers; None if there is no such property any longer."""
    try:
        value = owner.path_resolve(path)
    except ValueError:
        return None
    if isinstance(value, (bool, int, float, str)):
        return value
    return list(value) if hasattr(value, "__len__") else None


def _own_of(kind: str) -> dict:
    """What this file itself has in a collection of `bpy.data`, by name; Blender's own look-up compares name after name."""
    return {thing.name: thing for thing in getattr(bpy.data, kind) if thing.library is None}


def _kinds() -> list[str]:
    """Collections of `bpy.data` whose members may have keys."""
    lists = [p for p in bpy.data.bl_rna.properties if p.type == "COLLECTION"]
    return [p.identifier for p in lists if "animation_data" in p.fixed_type.properties]


def _owner(thing, within: bool):
    """A data block, or the node tree that is part of it."""
    return getattr(thing, "node_tree", None) if within else thing


def _written(owner, placed: bool) -> list[tuple[str, object]]:
    """Paths that animation writes, and their values; without those of PLACE if it is `placed`, as objects are."""
    if not _has_keys(owner):
        return []
    paths = [path for path in animated(owner.animation_data) if not (placed and _CHANNEL.fullmatch(path))]
    return [(path, value) for path in paths if (value := value_of(owner, path)) is not None]


def _write(owner, path: str, value) -> None:
    if path.endswith('"]'):  # a custom property
        of, _, key = path[:-2].rpartition('["')
        (owner.path_resolve(of) if of else owner)[bpy.utils.unescape_identifier(key)] = value
    else:
        of, _, name = path.rpartition(".")
        try:
            setattr(owner.path_resolve(of) if of else owner, name, value)
        except (AttributeError, TypeError, ValueError):  # something that only animation may write
            return
    owner.update_tag()


def _has_keys(owner) -> bool:
    """Whether a data block, if it is one, has an action or NLA tracks."""
    data = getattr(owner, "animation_data", None)
    return data is not None and (data.action is not None or len(data.nla_tracks) > 0)


def _keys(thing):
    return getattr(thing.data, "shape_keys", None)


def _channels(thing) -> dict[tuple, np.ndarray]:
    """Values by (owner, channel): the owner is "" for the object, "bones" or "shapes" for all of them at once, or the
    name of a bone with properties of its own.
    """
    found = {("", name): np.array(getattr(thing, name)[:]) for name in PLACE}
    found |= {("", key): value for key, value in _own(thing)}
    if thing.pose is not None:
        bones = thing.pose.bones
        for name, size in PLACE.items():
            values = np.empty(len(bones) * size, np.float32)
            bones.foreach_get(name, values)
            found["bones", name] = values
        found |= {(bone.name, key): value for bone in bones for key, value in _own(bone)}
    if _keys(thing) is not None:
        values = np.empty(len(_keys(thing).key_blocks), np.float32)
        _keys(thing).key_blocks.foreach_get("value", values)
        found["shapes", "value"] = values
    return found


def _own(owner) -> list:
    """Numbers among the custom properties, such as switches between IK and FK."""
    return [(f'["{key}"]', value) for key, value in owner.items() if isinstance(value, (int, float))]


def _set(thing, key: tuple, values) -> None:
    owner, channel = key
    if owner == "bones" and channel in PLACE:
        if len(values) == PLACE[channel] * len(thing.pose.bones):
            thing.pose.bones.foreach_set(channel, values)
    elif owner == "shapes" and channel == "value":
        _keys(thing).key_blocks.foreach_set("value", values)
    elif channel in PLACE:
        setattr(thing, channel, values)
    else:
        (thing.pose.bones[owner] if owner else thing)[channel[2:-2]] = values
