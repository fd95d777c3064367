# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake of hair bones as keyframes: on tracks of its own, which can be muted and removed."""

from contextlib import contextmanager

import bpy
import numpy as np

from neuralocks_core.errors import NeuralocksError

from ..objects.animated import animated
from ..objects.lookup import identified, identity
from ..objects.relations import found_anew
from . import rotations, sole_action
from .keyframes import keyed_action, put_on_top

TRACK, BEFORE = "Neuralocks Hair", "Neuralocks Before Hair"
"""NLA tracks of the hair's motion and, below it, of what the hair bones did before."""
OVERRIDE = " (Override)"
"""Suffix of both names on an overridden character, whose own file may have such tracks: Blender identifies tracks by name, and
would give those the content of the new ones."""
HAIR = TRACK, BEFORE, TRACK + OVERRIDE, BEFORE + OVERRIDE
"""All names of these tracks."""
KEPT = "neuralocks_rotations"
"""Property of the action that holds the hair bones' earlier rotations."""
ALONE = "neuralocks_alone"
"""Property of the same action that holds how the artist's action was set; see `sole_action`."""
STILL = 1e-6
"""Rotations that change by less than this over time do not move."""


def bake_keys(armature, bones, hair: tuple[np.ndarray, np.ndarray], own: tuple[np.ndarray, np.ndarray]):
    """Key the rotations of the hair bones and put them on a strip above all other animation, in place of an earlier bake. A strip
    below it holds what they did before, because Blender leaves a channel at its last value when its strip is muted.

    Args:
        armature: the armature object.
        bones: bone names, (N).
        hair, own: frames (T,), as animation counts them, and rotations (T, N, 4) wxyz there, with and without the hair's motion.
            Its own motion is wanted in all of the shot: muted, a bake of a part of it must not hold the bones still in the rest.

    Returns:
        the action of the hair's motion.
    """
    settings = armature.neuralocks_character
    whole = any(KEPT in action for action in _actions(armature))  # otherwise its track was deleted by hand
    older = ("", "") if whole else (settings.keys_kept, settings.keys_alone)
    _take_off(armature)
    data = armature.animation_data or armature.animation_data_create()
    # The artist's own keys on a bone, which may be in the action above all strips, stay and have no effect.
    modes = rotations.free_modes(armature, bones, rotations.KEYED, without=HAIR)
    before = rotations.kept(armature, bones)
    for name in bones:
        armature.pose.bones[name].rotation_mode = modes[name]
    frames, before_hair = own
    needed = 1 if np.ptp(before_hair, axis=0).max(initial=0.0) < STILL else len(frames)
    ending = OVERRIDE if armature.override_library else ""
    below = keyed_action(armature, f"{armature.name} Before Hair", modes, frames[:needed], before_hair[:needed])
    put_on_top(data, BEFORE + ending, below)
    action = keyed_action(armature, f"{armature.name} Hair", modes, *hair)
    action[KEPT], action[ALONE] = before, sole_action.keep_alone(data, HAIR)
    # If tracks are deleted by hand, the first bake knows the artist's own rotations.
    settings.keys_kept = rotations.joined(before, older[0])
    settings.keys_alone = older[1] or action[ALONE]
    put_on_top(data, TRACK + ending, action)
    return action


def check_heard(armature) -> None:
    """Refuse an armature on which baked keys would have no effect.

    Raises:
        NeuralocksError: a strip is being tweaked, strips are switched off, or only another track plays, or will when the file is
            reopened.
    """
    name, data = armature.name_full, armature.animation_data
    if data is None:
        return
    if data.use_tweak_mode:  # the action above all strips, perhaps on hair bones, cannot be reached in tweak mode
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
    """Refuse an overridden character from which an earlier bake cannot be removed for good.

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
    """Refuse bones on which baked keys would have no effect, or a wrong one.

    Raises:
        NeuralocksError: a bone has keys in every rotation mode, or on the mode itself.
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
    """Whether there is a bake of its hair bones to remove: its tracks, or, if these were deleted by hand, what it did to the bones."""
    if _tracks(armature):
        return True
    data = armature.animation_data
    strips = [strip for track in data.nla_tracks for strip in track.strips] if data else []
    # If the artist renamed the track, it plays on, and is the artist's.
    playing = any(strip.action and KEPT in strip.action for strip in strips)
    return bool(armature.neuralocks_character.keys_kept) and not playing


def stored(armature, key: str):
    """What is stored under a key with hair keys that play; None if nothing is."""
    return next((action[key] for action in _actions(armature, playing=True) if key in action), None)


def beside_others(armature) -> bool:
    """Whether its hair bones are baked and play besides everything else: if their track is solo, nothing else plays."""
    tracks = _tracks(armature)
    return bool(tracks) and not any(track.is_solo for track in tracks)


def as_before(armature, playing: bool = False) -> dict[str, dict[str, list]]:
    """Channels of live or baked hair bones, by bone and name, as they are without the hair's motion; with `playing`, only of those that
    have that motion, because their track is not muted.
    """
    kept = rotations.kept_in(armature.neuralocks_character.rig_kept)
    for action in _actions(armature, playing):  # Live over baked keys has stored what the keys write
        kept |= rotations.kept_in(action.get(KEPT, ""))
    return {name: dict(zip(rotations.KEPT, values)) for name, values in kept.items()}


def remove(armature) -> str:
    """Remove an earlier bake and turn the bones as they were before it, also one whose tracks were deleted by hand. Tracks from the
    file of an overridden character, which Blender would bring back when this file is opened, are muted; returns that file's name,
    empty if there are none.
    """
    muted, settings = _take_off(armature), armature.neuralocks_character
    rotations.give_back(armature, settings.keys_kept, keyed=True, without=HAIR)
    sole_action.give_back(armature.animation_data, settings.keys_alone, HAIR)
    settings.keys_kept = settings.keys_alone = ""
    return muted


def _take_off(armature) -> str:
    """Remove a bake that is on tracks, as `remove` does."""
    tracks, actions, lasting = _tracks(armature), _actions(armature), _of_library(armature)
    muted = _library(armature) if any(track in lasting for track in tracks) else ""
    for track in tracks:
        _unstar(track)
        if track in lasting:
            track.mute = True
        else:
            armature.animation_data.nla_tracks.remove(track)
    for action in actions:
        rotations.give_back(armature, action.get(KEPT, ""), keyed=True, without=HAIR)
        sole_action.give_back(armature.animation_data, action.get(ALONE, ""), HAIR)
        if not action.users:  # otherwise somebody keeps it
            bpy.data.actions.remove(action)
    return muted


@contextmanager
def without(armature):
    """In this block, an earlier bake is off, and the bones are turned as they were before it."""
    number, tracks = identity(armature), {track.name: (track.mute, track.is_solo) for track in _tracks(armature)}
    before = [action.get(KEPT, "") for action in _actions(armature)]
    turned = rotations.kept(armature, [bone for text in before for bone in rotations.kept_in(text)])
    try:
        for track in _tracks(armature):
            _unstar(track)
            track.mute = True
        for text in before:
            rotations.give_back(armature, text, keyed=True, without=HAIR)
        yield
    finally:
        armature = identified(number)  # looked up again: there may have been an undo
        for track in _named(armature) if armature is not None else ():
            track.mute, solo = tracks.get(track.name, (track.mute, False))
            if solo:
                track.is_solo = True
        if armature is not None:
            rotations.give_back(armature, turned)
            if not _others_play(armature):
                found_anew()  # Blender looked at the rig while it had no keys


def _others_play(armature) -> bool:
    """Whether anything other than the hair's tracks animates this armature."""
    data = armature.animation_data
    return bool(data) and (bool(data.action) or any(not t.mute and t.name not in HAIR for t in data.nla_tracks))


def _unstar(track) -> None:
    """End the solo of a track: it would play alone although it is muted, and leave all others silent when it is gone."""
    if track.is_solo:  # clearing it on any other track would clear the star of the one that has it
        track.is_solo = False


def _tracks(armature) -> list:
    """Tracks of an earlier bake; without those from the file of an overridden character if all of them are muted, because that is
    how they are removed.
    """
    lasting = _of_library(armature)
    off = all(track.mute and not track.is_solo for track in lasting)
    return [track for track in _named(armature) if not (off and track in lasting)]


def _named(armature) -> list:
    """Tracks with the hair's names."""
    data = armature.animation_data
    return [track for track in data.nla_tracks if track.name in HAIR] if data else []


def _of_library(armature) -> list:
    """Those tracks that an overridden character has from its own file."""
    return [track for track in _named(armature) if track.is_override_data] if armature.override_library else []


def _library(armature) -> str:
    """The name of the file that an overridden armature is from."""
    return armature.override_library.reference.library.name


def _actions(armature, playing: bool = False) -> list:
    tracks = [track for track in _tracks(armature) if not (playing and track.mute)]
    return [strip.action for track in tracks for strip in track.strips if strip.action]
