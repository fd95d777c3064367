# SPDX-License-Identifier: GPL-3.0-or-later
"""Model files as the panel names them."""

import os

from neuralocks_core import model as model_file
from neuralocks_core.runtime import StrandModel

from .scene.paths import absolute
from .session import session


def load_model(found: str) -> StrandModel:
    """The model of an absolute path, read once while it does not change; calls nothing of Blender."""
    stamp = (os.path.getmtime(found), os.path.getsize(found)) if os.path.isfile(found) else None
    kept = session.models.get(found)
    if kept is None or kept[0] != stamp:
        kept = session.models[found] = stamp, StrandModel.load(found)
    return kept[1]


def model_path(path: str, kind: str = "strands") -> str:
    """Absolute path of a model named in the panel; the shipped one where it is empty."""
    if not path.strip():
        return str(model_file.shipped(kind))
    return absolute(path)
