# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose motion edited keys may change."""

import bpy

from ...session import session

ALOOF = {"CAMERA", "LIGHT", "LIGHT_PROBE", "SPEAKER"}
"""Types of objects whose keys only move what is known to depend on them, as do those of other characters. Meshes and empties may also be
named by node groups, and rigs of controls read in roundabout ways, which are not followed.
"""


def concerns(users, moved_by: frozenset[str]) -> bool:
    """Whether keys that these data blocks play may change the motion of a rig that objects of these names move. Keys that nothing plays
    may have been just taken away.
    """
    return not users or any(not _elsewhere(user, moved_by) for user in users)


def _elsewhere(user, moved_by: frozenset[str]) -> bool:
    if not isinstance(user, bpy.types.Object) or user.name_full in moved_by:
        return False
    return user.type in ALOOF or user.name_full in session.rigs
