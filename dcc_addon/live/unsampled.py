# SPDX-License-Identifier: GPL-3.0-or-later
"""Live hair whose character's motion is not sampled yet."""

import bpy

from neuralocks_core.errors import NeuralocksError

from ..session import session

FIRST = "its motion is sampled as soon as playback stops; then the hair moves"
"""What an artist has to wait for, without doing anything."""


def unsampled(name: str, why: str = "its motion is not sampled yet") -> NeuralocksError:
    """The error that an armature's motion is unknown. Making it requests the motion: with a window, it is sampled in the
    background, unless that has failed.
    """
    failed = name in session.sampling.failed
    session.sampling.wanting = session.sampling.wanting or not failed
    told = f"{why}; press Sample Motion" if bpy.app.background or failed else FIRST
    return NeuralocksError(f"{name}: {told}")
