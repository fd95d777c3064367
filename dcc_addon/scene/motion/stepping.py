# SPDX-License-Identifier: GPL-3.0-or-later
"""Showing one frame after the other to read them, then restoring the scene."""

from contextlib import ExitStack

import bpy
import numpy as np

from ...session import session
from ..drawing.clock import shown_frame
from ..keys import hair_keys, rotations
from ..objects.lookup import find
from .unkeyed_poses import Unkeyed


def step(scene, frame: float) -> None:
    """Show a frame, with its fraction."""
    whole = int(np.floor(frame + 1e-6))
    scene.frame_set(whole, subframe=max(0.0, float(frame - whole)))


class stepping:
    """While frames are stepped: the live view is off, hair bones are turned as without it and without baked keys, and the
    current frame comes back at the end, with poses that are not keyed and the camera, which markers may have changed.
    """

    def __init__(self, scene):
        self._scene = scene

    def __enter__(self):
        self._frame = shown_frame(self._scene)  # before frame 0, the fraction is negative
        self._unkeyed = Unkeyed(self._scene)
        self._camera = self._scene.camera and self._scene.camera.name_full
        self._live = {}
        for armature in (o for o in self._scene.objects if o.type == "ARMATURE" and o.neuralocks_character.rig_kept):
            text = armature.neuralocks_character.rig_kept
            self._live[armature.name_full] = rotations.kept(armature, rotations.kept_in(text))
            rotations.give_back(armature, text, keyed=True)
        self._keyed = ExitStack()
        for armature in (o for o in self._scene.objects if o.type == "ARMATURE" and hair_keys.beside_others(o)):
            self._keyed.enter_context(hair_keys.without(armature))
        session.paused += 1

    def __exit__(self, *_):
        try:
            self._keyed.close()
            step(self._scene, self._frame)
            self._unkeyed.put_back()
            self._give_back_camera()
            for name, turned in self._live.items():
                if (armature := find(name)) is not None:
                    rotations.give_back(armature, turned)
            bpy.context.view_layer.update()  # what is restored is not an edit of the artist's
        finally:
            session.paused -= 1

    def _give_back_camera(self) -> None:
        camera = find(self._camera) if self._camera else None
        if self._scene.camera != camera and bool(camera) == bool(self._camera):
            self._scene.camera = camera
