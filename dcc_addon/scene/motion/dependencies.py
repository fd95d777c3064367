# SPDX-License-Identifier: GPL-3.0-or-later
"""What a sampling of a rig's motion depends on, so that one that is out of date is noticed."""

import bpy

from ...live_state import Key
from ...session import session
from ..character.carried import bodies_of, hairs_of
from ..drawing.clock import rate_of, stretch_of
from ..drawing.visibility import enabled
from ..objects.animated import animated
from .rigging import posture, reached, rigging, unreported


def frames_of(scene) -> tuple[int, int]:
    """First and last frame to sample: those of the scene, and those that the panel names for the bake, so that view and bake
    remember the same past. Without a window, also those that the file had when it was opened: a render farm gives each machine a
    part of them (-s 100 -e 120), and all parts must remember what the whole would.
    """
    settings, ranges = scene.neuralocks, [(scene.frame_start, scene.frame_end)]
    if not settings.use_scene_range:
        ranges.append((settings.frame_start, settings.frame_end))
    if bpy.app.background and scene.name_full in session.opened:
        ranges.append(session.opened[scene.name_full])
    return min(first for first, _ in ranges), max(last for _, last in ranges)


def begins_later(scene) -> bool:
    """Whether the frames to sample begin later than when the file was opened, as to render a part of a shot again: hair is then at rest
    where they begin.
    """
    first, last = session.opened.get(scene.name_full, (0, -1))
    return first < frames_of(scene)[0] <= last


def timing_of(scene) -> tuple:
    """What a sampling depends on in the scene: frames, sub-frames, time stretching, rate, unit."""
    return (
        *frames_of(scene),
        scene.neuralocks.subframes,
        stretch_of(scene),
        round(rate_of(scene), 6),
        round(scene.unit_settings.scale_length, 9),
    )


def key_of(armature, scene) -> Key:
    """What a sampling of this armature depends on as the scene is."""
    return Key(
        timing_of(scene),
        armature.neuralocks_character.head_bone,
        tuple(armature.data.bones.keys()),
        tuple(body.name_full for body in bodies_of(armature, scene)),
        tuple(sorted(o.name_full for o in hairs_of(armature, scene))),
    )


def rigging_of(armature, scene) -> int:
    """A number that changes when the setup that moves this armature, its hair or its bodies changes."""
    return rigging(_moved_together(armature, scene))


def posture_of(armature, scene) -> int:
    """A number that changes when unkeyed values pose this armature, or what it depends on, differently; hair bones count as they
    are without the hair's motion.
    """
    return posture(_moved_together(armature, scene))


def edited_unseen(armature, scene, known: dict[str, int]) -> bool:
    """Whether a body was edited that some view layer leaves out; `known` are the numbers of bodies that are as they were sampled."""
    unseen = (body for body in bodies_of(armature, scene) if body.name_full in known and not _always_shown(body, scene))
    return any(unreported(body) != known[body.name_full] for body in unseen)


def moved_by(armature, scene) -> frozenset[str]:
    """Names of the objects that move this armature, its hair or its bodies, with itself and the bodies."""
    found = reached(_moved_together(armature, scene))
    return frozenset(thing.name_full for thing in found if thing.type != "CURVES")


def _always_shown(body, scene) -> bool:
    keyed = "hide_viewport" in animated(body.animation_data)
    return not keyed and all(enabled(body, layer) for layer in scene.view_layers)


def _moved_together(armature, scene) -> list:
    return [armature, *hairs_of(armature, scene), *bodies_of(armature, scene)]
