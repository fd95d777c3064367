# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators: thin, each calling one function elsewhere that scripts and tests can call as well."""

from . import bake, character, rig, strands, training

CLASSES = (*character.CLASSES, *strands.CLASSES, *training.CLASSES, *rig.CLASSES, *bake.CLASSES)
