# SPDX-License-Identifier: GPL-3.0-or-later
"""What hair bones were when they were keyed, stored with the action: what moved their character, and what the panel set. Keys go on
showing these as they were.
"""

from ..keys import hair_keys
from ..objects import records
from . import character_record, motion_record

KEY = "neuralocks_keyed"
"""The property of the action: a number for each part."""
REMEDY = "Bake to Keyframes"


def remember(action, armature, scene, frames: tuple[int, int]) -> None:
    """Store with a bake of these frames, first and last, what it was made of."""
    motion_record.remember(action, armature, scene, frames)
    action[KEY] = records.as_text(_numbers(armature, scene))


def changed_since(armature, scene) -> str:
    """What was changed since hair keys that play were baked, and shows in this frame, with the remedy; empty if nothing is known to be."""
    return motion_record.changed(hair_keys.stored(armature, motion_record.KEY), armature, scene, REMEDY)


def note(armature, scene) -> str:
    """What the panel says about settings that were changed since keys that play were baked; nothing while the bones are live."""
    if armature.neuralocks_character.rig_live:
        return ""
    told = hair_keys.stored(armature, KEY)
    parts = [] if told is None else records.changed(told, _numbers(armature, scene))
    return records.note(parts, REMEDY) if parts else ""


def _numbers(armature, scene) -> dict[str, int]:
    own = armature.neuralocks_character
    return {
        "Motion": records.number_of(round(own.rig_motion, 6)),
        "Model": character_record.model(armature, "rig"),
        "Chains": records.number_of(own.chains),
        "wind": character_record.wind(armature),
        **character_record.others(armature, scene),
    }
