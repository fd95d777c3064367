# SPDX-License-Identifier: GPL-3.0-or-later
"""What hair was baked of, stored with the bake, so that the panel sees when the shot was changed afterwards: also after the file was
opened again, and without sampling the motion again.
"""

import os
import zlib
from functools import lru_cache

import bpy
import numpy as np

from ...session import session
from ..character.armature import matrix
from ..character.layers import layer_of
from ..drawing.clock import rate_of, shown_frame, stretch_of

KEY = "neuralocks_baked"
"""The property of a cache file, or of an action with hair keys, that stores it."""
MOST = 2000
"""Most frames of which is stored how the head stood."""
NEAR = 1e-3
"""Turns [rad] and ways, in Blender's units, that are not told from none."""
ROUNDED = 1e-6
"""Far from the origin, ways of this share of the distance are not, either."""
PIECES, PIECE = 256, 64
"""A file is known by so many pieces of so many bytes: a whole bake would take seconds to read, and no two are alike in all of these."""
RETIMED = "the frame rate or Time Stretching was changed after the bake, so it plays the old motion; press {} again"
BEYOND = "frames {first} to {last} were baked, and this one was not; to let it move here, press {} again"
ANOTHER = "its file was baked anew after this Blender file was saved, perhaps from other animation; press {} again"
MOVED = (
    "in this frame the head is not where it was when the hair was baked; if the animation was changed, press {} again"
)


def remember(block, armature, scene, frames: tuple[int, int], path: str = "") -> dict:
    """Store with a bake of these frames, first and last, the scene's timing, how the head of this armature stands in them, in the motion
    that was sampled for it, and which file is at `path`, if it is one; returns what is stored.
    """
    sampled = session.rigs[armature.name_full]
    head, numbers = sampled.character.head, sampled.motion.frames
    rows = np.flatnonzero((numbers % 1 == 0) & (numbers >= frames[0]) & (numbers <= frames[1]))[:MOST]
    stood = sampled.drawn[rows, head].astype(float) @ np.linalg.inv(sampled.trim[head])
    told = {
        "bone": sampled.rig.bones[head],
        "first": int(frames[0]),
        "last": int(frames[1]),
        "timing": [rate_of(scene), stretch_of(scene)],
        "heads": stood[:, :3],
        "file": print_of(path),
    }
    block[KEY] = told | {"heads": stood[:, :3].ravel().tolist()}
    return told


def changed(told, armature, scene, remedy: str, path: str = "") -> str:
    """What was changed since a bake, of which `told` was stored, perhaps in the file at `path`, and shows in this frame, with the remedy;
    empty if nothing is known to be.
    """
    told = _checked(told)
    if told is None or armature is None:
        return ""
    if print_of(path) not in ("", told["file"]):
        return ANOTHER.format(remedy)
    first, last, frame = told["first"], told["last"], shown_frame(scene)
    if not np.allclose(told["timing"], [rate_of(scene), stretch_of(scene)], rtol=1e-6, atol=0):
        return RETIMED.format(remedy)
    if not first <= frame <= last:
        rendered = scene.frame_start <= frame <= scene.frame_end
        return BEYOND.format(remedy, first=first, last=last) if rendered else ""
    return MOVED.format(remedy) if _moved(told, armature, scene, frame) else ""


def print_of(path: str) -> str:
    """A number of a file's content; empty if there is none."""
    try:
        state = os.stat(path)
        return _print(path, state.st_mtime_ns, state.st_size)
    except OSError:
        return ""


def _moved(told, armature, scene, frame: float) -> bool:
    """Whether the head is drawn elsewhere than when the hair was baked; not if that is unknown: between frames, and where Blender does
    not pose the armature.
    """
    bone, stood = armature.pose.bones.get(told["bone"]), told["heads"]
    row = round(frame) - told["first"]
    if bone is None or row >= len(stood) or abs(frame - round(frame)) > NEAR:
        return False
    if layer_of(armature, scene) != bpy.context.view_layer:
        return False
    off, size = matrix(armature.matrix_world @ bone.matrix)[:3] - stood[row], np.abs(stood[row, :, :3]).max()
    far = NEAR + ROUNDED * np.abs(stood[row, :, 3])
    return bool(np.abs(off[:, :3]).max() > NEAR * size or (np.abs(off[:, 3]) > far).any())


def _checked(told) -> dict | None:
    """What `remember` stored, with arrays; None for anything else that a file may hold in its place."""
    try:
        found = {name: kind(told[name]) for name, kind in (("bone", str), ("first", int), ("last", int), ("file", str))}
        found |= {name: np.array(told[name], float) for name in ("timing", "heads")}
        found["heads"] = found["heads"].reshape(-1, 3, 4)
    except (TypeError, ValueError, LookupError, OverflowError):
        return None
    return found if found["timing"].shape == (2,) else None


@lru_cache(64)
def _print(path: str, _written: int, size: int) -> str:
    number = zlib.crc32(str(size).encode())
    with open(path, "rb") as file:
        for place in np.linspace(0, max(size - PIECE, 0), PIECES).astype(int).tolist():
            file.seek(place)
            number = zlib.crc32(file.read(PIECE), number)
    return f"{number:08x}"
