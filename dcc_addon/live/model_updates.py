# SPDX-License-Identifier: GPL-3.0-or-later
"""Live hair that names no model moves by one of those that come with the add-on. An update may bring others: then the hair of a
file that was saved before says so.
"""

import hashlib
from functools import cache

import bpy

from neuralocks_core.models import model_file

from ..scene.objects.live_objects import lively
from ..session import session

NOTE = (
    "The models that come with the add-on are others than when this file was saved, so this hair may move differently"
)


def remember() -> None:
    """Before a save: note which model moves the live hair."""
    for hair in _shipped_hair():
        if hair.library is None:
            hair.neuralocks_hair.shipped = _checksum()
    session.model_updated.clear()


def compare() -> None:
    """After another file was opened: find live hair that another model moved. Files of add-ons that noted none count as such."""
    if bpy.data.filepath:
        session.model_updated = {h.name_full for h in _shipped_hair() if h.neuralocks_hair.shipped != _checksum()}


def _shipped_hair() -> list:
    """Live hair that names no model."""
    return [hair for hair in lively(bpy.data.objects).hairs if not hair.neuralocks_hair.model.strip()]


@cache
def _checksum() -> str:
    files = (model_file.shipped(), *model_file.specialists())
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:16]
