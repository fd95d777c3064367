# SPDX-License-Identifier: GPL-3.0-or-later
"""What moves hair, strands and bones alike: what a character is set to, and a model, as numbers of a record; see `records`."""

from ...services.hair.wind import Blowing
from ..character.examined import examined
from ..files.paths import MODELS, full, library_of
from ..objects.records import number_of
from .motion_record import print_of


def wind(armature) -> int:
    """A number of the wind in the hair of an armature, or of none."""
    own = armature and armature.neuralocks_character
    return number_of(Blowing.of(own.wind, own.wind_direction, own.gusts) if own else Blowing())


def others(armature, scene) -> dict[str, int]:
    """Numbers of everything else, by what the panels call it; of an armature in a scene, or of none."""
    return {
        "Loop": number_of(armature is not None and armature.neuralocks_character.loop),
        "Head Bone or its rest place": number_of(_head(armature) if armature else []),
        "Unit Scale": number_of(round(scene.unit_settings.scale_length, 9)),
    }


def model(thing, kind: str) -> int | None:
    """A number of the model, of a kind of MODELS, that hair, or an armature with hair bones, names, told by what is in its file: a save in
    another folder names it otherwise. None if that cannot be read here.
    """
    path = thing.path_resolve(MODELS[kind]).strip()
    held = print_of(full(path, library_of(thing, MODELS[kind])))
    return None if path and not held else number_of([bool(path), held])


def _head(armature) -> list[float]:
    """Where the bone rests that carries the hair, chosen or found, for a name may be another and the bone the same; empty if there is
    none.
    """
    rig, head, _ = examined(armature)
    bone = armature.data.bones.get(rig.bones[head]) if rig is not None else None
    return [round(value, 5) for value in bone.head_local] if bone else []
