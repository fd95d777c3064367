# SPDX-License-Identifier: Apache-2.0
"""Notes on a model for the shot that it is asked to bake: what it never learned, and what of it is ignored."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from neuralocks_core.materials import Material
from neuralocks_core.measures import HIGHEST, LOWEST, MEASURES, body_measures
from neuralocks_core.runtime import StrandModel

from ..shot.attach import off_head
from ..shot.stage import Shot
from ..skel.source import StageRig

SPANS = HIGHEST - LOWEST
ELSEWHERE = np.where(np.isfinite(SPANS), 0.5 * SPANS, 0.03)
"""A measure [m] that lies farther outside what a model learned is another body's: on it hair moves as it would on the one that it
learned."""


def model_notes(model: StrandModel, material: Material, shot: Shot) -> list[str]:
    """What a user of a model should know: its report, and how material and characters differ from what it learned."""
    # A chest has not a head's measures.
    on_heads = [item.attachment for item in shot.grooms if not off_head(item.attachment)]
    heads = [rig for rig in shot.rigs if any(found.rig is rig for found in on_heads)]
    return [*_unheard(model, material), *_other_bodies(model, heads), *model.file.shortcomings()]


def _unheard(model: StrandModel, material: Material) -> list[str]:
    """The note on constants that are not as in the one material that a model was trained with."""
    options = model.meta["training"].get("options")
    varied = options.get("random_materials", True) if isinstance(options, dict) else True
    plain = replace(material, clumping=Material.clumping)  # whose effect no network learns
    if varied or plain == Material():
        return []
    return [
        "the model was trained with one material, so stiffness, weight and damping change nothing; "
        "train one with random_materials=True, as the other ways of training do"
    ]


def _other_bodies(model: StrandModel, rigs: Iterable[StageRig]) -> list[str]:
    """The notes on characters of other measures than those that a model was trained on. Silent where its card tells none."""
    learned = model.meta["training"].get("measures")
    try:
        lowest, highest = (np.asarray(learned[name], float).reshape(len(MEASURES)) for name in ("lowest", "highest"))
    except (TypeError, KeyError, ValueError, OverflowError):  # a card comes out of a file, and may hold anything
        return []
    notes = []
    for rig in rigs:
        measures = body_measures(rig.character, rig.clip.shape[0])
        outside = np.maximum(lowest - measures, measures - highest) / ELSEWHERE
        if outside.max() > 1:
            i = int(outside.argmax())
            notes.append(
                f"{rig.path}: the model was trained on another body: {MEASURES[i]} {measures[i]:.3g} m (trained: {lowest[i]:.3g} "
                f"to {highest[i]:.3g}); if hair moves oddly or lies in the body, take the shipped model, or train one on this one"
            )
    return notes
