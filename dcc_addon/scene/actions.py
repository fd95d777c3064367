# SPDX-License-Identifier: GPL-3.0-or-later
"""Keyframes on the hair bones only, in a separate action that can be muted."""

from contextlib import contextmanager

import bpy
import numpy as np

from neuralocks_core.errors import NeuralocksError

from . import rotations
from .animated import animated
from .lookup import identified, identity
from .relations import found_anew

TRACK, BEFORE = "Neuralocks Hair", "Neuralocks Before Hair"
"""NLA tracks of the hair's motion and, below it, of what the hair bones did before."""
OVERRIDE = " (Override)"
"""How the names of both end on an overridden character, whose own file may have tracks of them: Blender knows them by name,
and would give these what the new ones have."""
HAIR = TRACK, BEFORE, TRACK + OVERRIDE, BEFORE + OVERRIDE
"""All of them."""
KEPT = "neuralocks_rotations"
"""Property of the action with how the hair bones were turned before."""
STILL = 1e-6
"""Rotations that change by less over time do not move."""


def bake_keys(armature, bones, frames: np.ndarray, turns: np.ndarray, own: np.ndarray):
    """Key the rotations of the hair bones and put them on a strip above all other animation, in place of an earlier bake;
    on one below it what they did before, for Blender leaves at its last value what a muted strip writes no more.

    Args:
        armature: the armature object.
        bones: bone names, (N).
        frames: (T,), as animation counts them.
        turns, own: rotations (T, N, 4) wxyz with the hair's motion and without.

    Returns:
        the action of the hair's motion.
    """
    remove(armature)
    data = armature.animation_data or armature.animation_data_create()
    # Keys of the artist's own on a bone, which may lie in the action above all strips, stay and have no effect.
    modes = rotations.free_modes(armature, bones, rotations.KEYED, without=HAIR)
    before = rotations.kept(armature, bones)
    for name in bones:
        armature.pose.bones[name].rotation_mode = modes[name]
    if frames[0] % 1:  # a strip begins at a whole frame
        frames = np.concatenate([np.floor(frames[:1]), frames])
        turns, own = (np.concatenate([each[:1], each]) for each in (turns, own))
    needed = 1 if np.ptp(own, axis=0).max(initial=0.0) < STILL else len(frames)
    ending = OVERRIDE if armature.override_library else ""
    below = _action(armature, f"{armature.name} Before Hair", modes, frames[:needed], own[:needed])
    _strip(data, BEFORE + ending, below)
    action = _action(armature, f"{armature.name} Hair", modes, frames, turns)
    action[KEPT] = before
    _strip(data, TRACK + ending, action)
    return action


def check_heard(armature) -> None:
    """Refuse where baked keys would not be heard.

    Raises:
        NeuralocksError: a strip is being tweaked, strips are switched off, or those of another track alone play, or will when
            the file is opened again.
    """
    name, data = armature.name_full, armature.animation_data
    if data is None:
        return
    if data.use_tweak_mode:  # the action that plays above all strips, perhaps on hair bones, is out of reach meanwhile
        raise NeuralocksError(
            f"{name}: an NLA strip is being edited (tweak mode); leave it first (Tab in the NLA editor)"
        )
    if not data.use_nla:
        raise NeuralocksError(
            f"{name}: its NLA is switched off, so baked keys do not play; switch it on in the NLA editor"
        )
    for track in data.nla_tracks:
        if track.is_solo and track.name not in HAIR:
            raise NeuralocksError(
                f"{name}: NLA track '{track.name}' is solo, so no other track plays; switch off its star"
            )
    check_lasting(armature)


def check_lasting(armature) -> None:
    """Refuse where an earlier bake cannot be taken off an overridden character for good.

    Raises:
        NeuralocksError: a track of it from the character's own file is solo.
    """
    for track in _of_library(armature):
        if track.is_solo:
            raise NeuralocksError(
                f"{armature.name_full}: NLA track '{track.name}' of {_library(armature)} is solo, and Blender makes it solo "
                "again when this file is opened; switch off its star in that file"
            )


def check_mode_left(armature, bones) -> None:
    """Refuse bones on which baked keys would have no effect, or another one.

    Raises:
        NeuralocksError: one has keys in every rotation mode, or of the mode itself.
    """
    written = animated(armature.animation_data, without=HAIR)
    for bone in bones:
        start = f'pose.bones["{bpy.utils.escape_identifier(bone)}"].'
        if all(start + rotations.CHANNELS[mode] in written for mode in rotations.KEYED):
            raise NeuralocksError(
                f"{armature.name_full}: hair bone '{bone}' has keys in every rotation mode, and these would override baked "
                "keys; delete its keys of one mode"
            )
        if f"{start}rotation_mode" in written:
            raise NeuralocksError(
                f"{armature.name_full}: hair bone '{bone}' has keys on its rotation mode, so baked keys would not play; "
                "delete those keys"
            )


def has_keys(armature) -> bool:
    """Whether its hair bones are baked."""
    return bool(_tracks(armature))


def beside_others(armature) -> bool:
    """Whether its hair bones are baked and play beside all else: with the star of a track of theirs nothing else does."""
    return has_keys(armature) and not any(track.is_solo for track in _tracks(armature))


def as_before(armature) -> dict[str, dict[str, list]]:
    """Channels of the hair bones that are live or baked, by bone and name, as they are without the hair's motion."""
    kept = rotations.kept_in(armature.neuralocks_character.rig_kept)
    for action in _actions(armature):  # Live over baked keys has put aside what these write
        kept |= rotations.kept_in(action.get(KEPT, ""))
    return {name: dict(zip(rotations.KEPT, values)) for name, values in kept.items()}


def remove(armature) -> str:
    """Take an earlier bake off and turn the bones as they were before it. Tracks from the file of an overridden character,
    which Blender would bring back when this one is opened, are muted; gives that file's name, empty where there are none.
    """
    tracks, actions, lasting = _tracks(armature), _actions(armature), _of_library(armature)
    muted = _library(armature) if any(track in lasting for track in tracks) else ""
    for track in tracks:
        _unstar(track)
        if track in lasting:
            track.mute = True
        else:
            armature.animation_data.nla_tracks.remove(track)
    for action in actions:
        rotations.give_back(armature, action.get(KEPT, ""))
        if not action.users:
            bpy.data.actions.remove(action)
    return muted


@contextmanager
def without(armature):
    """Meanwhile an earlier bake is off, and the bones are turned as they were before it."""
    number, tracks = identity(armature), {track.name: (track.mute, track.is_solo) for track in _tracks(armature)}
    before = [action.get(KEPT, "") for action in _actions(armature)]
    turned = rotations.kept(armature, [bone for text in before for bone in rotations.kept_in(text)])
    try:
        for track in _tracks(armature):
            _unstar(track)
            track.mute = True
        for text in before:
            rotations.give_back(armature, text)
        yield
    finally:
        armature = identified(number)  # found anew: an undo may have come between
        for track in _named(armature) if armature is not None else ():
            track.mute, solo = tracks.get(track.name, (track.mute, False))
            if solo:
                track.is_solo = True
        if armature is not None:
            rotations.give_back(armature, turned)
            if not _others_play(armature):
                found_anew()  # what was looked at meanwhile had no keys


def _others_play(armature) -> bool:
    """Whether anything else than the hair's tracks is animation of this armature."""
    data = armature.animation_data
    return bool(data) and (bool(data.action) or any(not t.mute and t.name not in HAIR for t in data.nla_tracks))


def _unstar(track) -> None:
    """Let a track play no longer alone: it would do so although it is muted, and leave all others silent when it is gone."""
    if track.is_solo:  # to say so of any other one takes the star off that which has it
        track.is_solo = False


def _tracks(armature) -> list:
    """Tracks of an earlier bake; without those from the file of an overridden character where all of these are muted, for
    that is how they are taken off.
    """
    lasting = _of_library(armature)
    off = all(track.mute and not track.is_solo for track in lasting)
    return [track for track in _named(armature) if not (off and track in lasting)]


def _named(armature) -> list:
    """Tracks of the hair's names."""
    data = armature.animation_data
    return [track for track in data.nla_tracks if track.name in HAIR] if data else []


def _of_library(armature) -> list:
    """Those of them that an overridden character has from its own file."""
    return [track for track in _named(armature) if track.is_override_data] if armature.override_library else []


def _library(armature) -> str:
    """The name of the file that an overridden armature is from."""
    return armature.override_library.reference.library.name


def _actions(armature) -> list:
    return [strip.action for track in _tracks(armature) for strip in track.strips if strip.action]


def _strip(data, name: str, action) -> None:
    """Put an action on a new track above all others."""
    track = data.nla_tracks.new()
    track.name = name
    strip = track.strips.new(action.name, int(action.frame_range[0]), action)
    strip.blend_type, strip.extrapolation = "REPLACE", "HOLD"


def _action(armature, label: str, modes: dict[str, str], frames: np.ndarray, turns: np.ndarray):
    """An action with keys (T, N, 4) at frames (T,) in the rotation mode of each bone."""
    action = bpy.data.actions.new(label)
    curves = _curves(action, armature)
    for column, (name, mode) in enumerate(modes.items()):
        path = f'pose.bones["{bpy.utils.escape_identifier(name)}"].{rotations.CHANNELS[mode]}'
        for index, values in enumerate(rotations.values(mode, turns[:, column]).T):
            curve = _new_curve(curves, path, index, name)
            curve.keyframe_points.add(len(frames))
            keys = np.stack([frames, values], axis=1).astype(np.float32)
            curve.keyframe_points.foreach_set("co", keys.ravel())
            for point in curve.keyframe_points:
                point.interpolation = "LINEAR"
            curve.update()
    return action


def _curves(action, armature):
    """Where F-curves go: in Blender 4.4 and later into a channel bag of the action's slot for this armature."""
    if not hasattr(action, "slots"):
        return action.fcurves
    slot = action.slots.new("OBJECT", armature.name)
    layer = action.layers.new("Hair")
    return layer.strips.new(type="KEYFRAME").channelbag(slot, ensure=True).fcurves


def _new_curve(curves, path: str, index: int, group: str):
    """A curve in a group of its bone; how the group is named has changed twice."""
    for named in ({"group_name": group}, {"action_group": group}, {}):
        try:
            return curves.new(path, index=index, **named)
        except TypeError:
            continue
    raise RuntimeError(f"no F-curve for {path}")
