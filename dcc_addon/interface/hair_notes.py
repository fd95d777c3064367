# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist should know about a hair object, in the words of the panel."""

from neuralocks_core.models.model_file import kind_known

from ..live.model_updates import NOTE
from ..scene.baked import groom_record
from ..scene.baked.attach import has_cache
from ..scene.character.riding import on_hair_bone
from ..scene.hair import cached_strands, imported
from ..scene.hair.muting import off_meanwhile
from ..scene.objects import records
from ..session import session


def hair_notes(hair, scene) -> list[str]:
    """The notes on a hair object of a scene as it is now."""
    own, prepared, found = hair.neuralocks_hair, session.hairs.get(hair.name_full), []
    if prepared is not None:
        if fact := prepared.hair.another_body:
            found.append(f"The model was trained on another body: {fact}; if it shows, train one for this character")
        if far := prepared.hair.off_skin:
            found.append(f"Its roots are {far:.2g} m from the skin; put its object where the head is in the rest pose")
        blown = own.armature is not None and own.armature.neuralocks_character.wind > 0
        if blown and not prepared.hair.model.feels_wind:
            found.append("The model is for held poses, so this hair feels no wind")
    if hair.name_full in session.model_updated and own.live and not own.model.strip():
        found.append(NOTE)
    if has_cache(hair) and cached_strands.changed(hair.data):
        found.append("Its strands were changed since the bake, so its cache is off; press Bake and Attach again")
    elif has_cache(hair) and not own.live and (parts := groom_record.changed(hair, scene)):
        found.append(records.note(parts, "Bake and Attach"))
    if off := off_meanwhile(hair):
        found.append(f"Off while Live, or the hair would move twice: {', '.join(off)}")
    if not own.live and (problem := on_hair_bone(hair)):  # while it is live, that is an error
        found.append(problem)
    if own.armature is not None and (doubt := imported.doubt(hair)):
        found.append(doubt)
    return found


def unnamed_model(hair) -> str:
    """What the panel shows where a hair object names no model: that one is shipped, and which kind of hair it knows best."""
    prepared = session.hairs.get(hair.name_full)
    kind = kind_known(prepared.hair.model.file.path) if prepared is not None else ""
    return f"Shipped with the add-on: {kind} hair" if kind else "Shipped with the add-on"
