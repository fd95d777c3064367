# SPDX-License-Identifier: Apache-2.0
"""Notes on a model for the shot to bake: what it did not learn, and which settings it ignores."""

from collections.abc import Iterable
from dataclasses import replace

from neuralocks_core.materials import Material
from neuralocks_core.models.model_file import shipped, specialists
from neuralocks_core.models.runtime import StrandModel

from ..shot.carriers.attach import Attachment
from ..shot.notes.character_notes import untrained


def model_notes(
    model: StrandModel, material: Material, moved: Iterable[Attachment], strength: float = 1.0
) -> list[str]:
    """What a user of a model should know: its report, how material and the characters that carry the hair which it moves differ from
    what it learned, and whether motion strength acts.
    """
    unmoved = without_strength(strength, model.meta.get("static") is not True)
    return [*_unheard(model, material), *unmoved, *_other_bodies(model, moved), *model.file.shortcomings()]


def learned(model: StrandModel, moved: Iterable[Attachment]) -> list[str]:
    """Those of a shot's notes that do not hold for a model: of characters whose measures it was trained on."""
    carriers = {each.character: each for each in moved}  # not each groom: they are measured
    found = [each for each in carriers.values() if not each.off_head]
    known = [each for each in found if model.knows(each.character, each.rig.clip)]
    return [note for each in known for note in untrained(each.carrying)]


def without_strength(strength: float, dynamic: bool) -> list[str]:
    """The note on a motion strength that a model of held poses does not feel."""
    if strength == 1 or dynamic:
        return []
    return ["motion strength: has no effect on a model of held poses; leave it at 1, or give a dynamic model"]


def _unheard(model: StrandModel, material: Material) -> list[str]:
    """The note on constants that differ from the only material that a model was trained with."""
    options = model.meta["training"].get("options")
    varied = options.get("random_materials", True) if isinstance(options, dict) else True
    plain = replace(material, clumping=Material.clumping)  # no network learns its effect
    if varied or plain == Material():
        return []
    return [
        "the model was trained with one material, so stiffness, weight and damping change nothing; "
        "train one with random_materials=True, as the other ways of training do"
    ]


def _other_bodies(model: StrandModel, moved: Iterable[Attachment]) -> list[str]:
    """The notes on characters whose measures differ from those that a model was trained on."""
    on_heads = {each.rig.path: each for each in moved if not each.off_head}  # a chest does not have a head's measures
    own = model.file.path in (shipped(), *specialists())
    remedy = "use the shipped model, or train one on this character"
    if own:  # of those whose size no model knows, the shot's notes tell
        on_heads = {path: each for path, each in on_heads.items() if not untrained(each.carrying)}
        remedy = "train one on this character"
    told = {path: model.another_body(each.character, each.rig.clip) for path, each in on_heads.items()}
    return [
        f"{path}: the model was trained on another body: {fact}; if hair moves oddly or lies in the body, {remedy}"
        for path, fact in told.items()
        if fact
    ]
