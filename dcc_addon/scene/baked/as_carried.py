# SPDX-License-Identifier: GPL-3.0-or-later
"""What moves hair, strands and bones alike: what a character is set to, and a model, as numbers of a record; see `recorded`."""

from neuralocks_core.errors import NeuralocksError

from ...services.wind import Blowing
from ...session import session
from ..character.armature import found_by, read
from ..files.paths import MODELS, full, library_of
from ..objects.recorded import number_of
from .as_baked import print_of


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
    none. It is looked for when another may be found: that takes longer than a redraw may.
    """
    key, known = found_by(armature), session.heads.get(armature.name_full)
    if known is None or known[0] != key:
        try:
            rig = read(armature, armature.neuralocks_character.head_bone)
            found = rig.bones[rig.humanoid["head"]]
        except NeuralocksError:
            found = ""
        known = session.heads[armature.name_full] = key, found
    head = armature.data.bones.get(known[1])
    return [round(value, 5) for value in head.head_local] if head else []
