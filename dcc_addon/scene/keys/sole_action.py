# SPDX-License-Identifier: GPL-3.0-or-later
"""An armature's action while it plays alone: Blender looks at its influence, extrapolation and blending only if NLA strips play too.
With the first strips, such as those of baked hair bones, it would change.
"""

import json

import bpy

from ..objects.stored_values import are_numbers, remembered

AS_ALONE = {"action_influence": 1.0, "action_extrapolation": "HOLD", "action_blend_type": "REPLACE"}
"""The settings with which it plays beside strips as it does alone."""
OF = "action"
"""The name under which its settings are stored."""


def keep_alone(data, others) -> str:
    """Let the action of some animation data, or one that it gets later, play beside strips that are about to be added as it does
    without them; returns how it was set, as JSON, empty if that stays.

    Args:
        data: of the armature.
        others: names of the tracks that do not count, because they are about to be replaced.
    """
    if _strips_play(data, others):
        return ""
    found = [getattr(data, name) for name in AS_ALONE]
    _set(data, AS_ALONE.values())
    return json.dumps({OF: found})


def give_back(data, text: str, others) -> None:
    """Set the action as `keep_alone` found it; not if it was set otherwise since, or if other strips play by now."""
    found = remembered(text, _fits).get(OF)
    now = {name: getattr(data, name) for name in AS_ALONE} if data else {}
    if found and now == AS_ALONE and not _strips_play(data, others):
        _set(data, found)


def _strips_play(data, others) -> bool:
    return any(track.strips and not track.mute and track.name not in others for track in data.nla_tracks)


def _set(data, values) -> None:
    for name, value in zip(AS_ALONE, values, strict=True):
        setattr(data, name, value)


def _fits(values: list) -> bool:
    """Whether `keep_alone` writes such values."""
    _, *names = AS_ALONE
    kinds = [bpy.types.AnimData.bl_rna.properties[name].enum_items.keys() for name in names]
    return len(values) == 3 and are_numbers(values[:1], 1) and all(v in kind for v, kind in zip(values[1:], kinds))
