# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the actions and bodies of a sampling are as they were: after an undo, Blender reports everything as edited. Keys are first
read when an undo is about to happen: of the shipped shot, that takes a fifth as long as sampling it.
"""

import zlib

import bpy
import numpy as np

from ...sampled_rig import SampledRig
from ...services.rigs.rig import same_arrays
from ...session import session
from ..character.body import read
from ..objects import records
from ..objects.animated import curves_in, is_muted
from ..objects.keyed_motion import concerns
from ..objects.lookup import find
from ..objects.settings import as_set, settings_of
from .rigging import unreported

MOST_KEYS, MOST_VERTICES = 150_000, 10_000
"""More than these are not compared, and count as changed: undoing something else should not block Blender."""
KEY = {"co": 2, "handle_left": 2, "handle_right": 2, "amplitude": 1, "back": 1, "period": 1}
CHOICES = ("interpolation", "easing")
"""What keys of a curve are made of; numbers, and one of several."""


def note_actions() -> None:
    """Before an undo: note the actions of motions that are up to date, so that these are still as they were sampled. Blender has told of
    all edits by then: it evaluates them before it calls an operator.
    """
    for sampled in session.rigs.values():
        if sampled.actions is None and not sampled.stale:
            sampled.actions = _numbers_of(sampled.moved_by)


def _numbers_of(moved_by: frozenset[str]) -> dict[str, int]:
    """A number of each action, by name, of which the keys may change the motion of a rig that objects of these names move; none if
    these have too many keys.
    """
    users = bpy.data.user_map(subset=list(bpy.data.actions)).items()
    playing = [action for action, its in users if its and concerns(its, moved_by)]
    keys = sum(len(curve.keyframe_points) for action in playing for curve in curves_in(action))
    return {action.name_full: _number_of(action) for action in playing} if keys <= MOST_KEYS else {}


def as_sampled(name: str, sampled: SampledRig, actions, bodies: bool) -> bool:
    """Whether these actions, and if asked the bodies, are as they were when the armature of this name was sampled."""
    known = sampled.actions or {}
    if any(action.name_full not in known for action in actions):
        return False
    if any(known[action.name_full] != _number_of(action) for action in actions):
        return False
    return not bodies or all(_as_read(body, name, sampled) for body in sampled.body_arrays)


def _as_read(arrays, name: str, sampled: SampledRig) -> bool:
    """Whether a body, which was read as these arrays for the armature of this name, is as it was."""
    body, armature = find(arrays.name), find(name)
    if body is None or armature is None or unreported(body) != sampled.unreported.get(arrays.name):
        return False
    if body.data.name_full not in session.read.edited:
        return True
    small = len(body.data.vertices) <= MOST_VERTICES and len(body.data.polygons) > 0
    return small and same_arrays(read(body, armature), arrays)


def _number_of(action) -> int:
    return records.number_of([_curve(curve) for curve in curves_in(action)])


def _curve(curve) -> list:
    """All that tells how a curve plays."""
    points, samples = curve.keyframe_points, np.empty(2 * len(curve.sampled_points), np.float32)
    curve.sampled_points.foreach_get("co", samples)
    found = [curve.data_path, curve.array_index, is_muted(curve), curve.extrapolation, zlib.crc32(samples)]
    for name in (*KEY, *CHOICES):
        values = np.empty(KEY.get(name, 1) * len(points), np.float32 if name in KEY else np.int32)
        points.foreach_get(name, values)
        found.append(zlib.crc32(values))
    return [*found, *([modifier.type, *as_set(modifier, settings_of(modifier))] for modifier in curve.modifiers)]
