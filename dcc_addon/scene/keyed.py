# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose motion edited keys may change."""

import bpy

ALOOF = {"ARMATURE", "CAMERA", "LIGHT", "LIGHT_PROBE", "SPEAKER"}
"""Types of objects whose keys only move what is known to depend on them; meshes and empties may also be named by node groups, which are
not followed.
"""


def concerns(users, moved_by: frozenset[str]) -> bool:
    """Whether keys that these data blocks play may change the motion of a rig that objects of these names move. Keys that nothing plays
    may have been just taken away.
    """
    return not users or any(not _elsewhere(user, moved_by) for user in users)


def users_of(actions) -> list[set]:
    """The data blocks that play each action."""
    return list(bpy.data.user_map(subset=actions).values())


def _elsewhere(user, moved_by: frozenset[str]) -> bool:
    if isinstance(user, bpy.types.Object):
        return user.type in ALOOF and user.name_full not in moved_by
    return isinstance(user, (bpy.types.Camera, bpy.types.Light))
