# SPDX-License-Identifier: Apache-2.0
"""What a bake tells of its model: characters and materials that it never learned."""

from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.materials import Material
from neuralocks_core.measures import body_measures
from neuralocks_core.models.runtime import StrandModel
from usd.baking.bake import bake
from usd.baking.model_notes import model_notes
from usd.review.inspect import inspect
from usd.shot.notes import character_notes
from usd.shot.stage import read_shot

from ..shots import Recipe, write_shot


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    return read_shot(write_shot(tmp_path_factory.mktemp("shot")))


def test_a_character_without_a_measurable_body_is_told_elsewhere(model, tmp_path):
    shot = read_shot(write_shot(tmp_path, Recipe(bound="none")))
    assert _notes(model, shot, {"measures": {"lowest": [0.5] * 10, "highest": [0.6] * 10}}) == []


def carried(shot) -> list:
    return [item.attachment for item in shot.grooms]


def _notes(model, shot, card: dict) -> list[str]:
    plain = StrandModel.load(model).file
    mine = StrandModel(replace(plain, meta=plain.meta | {"training": card}))
    return model_notes(mine, Material(), carried(shot))


def _learned(shot, **changes) -> dict:
    own = body_measures(shot.rigs[0].character).tolist()
    lowest, highest = ([changes.get(end, {}).get(i, own[i]) for i in range(10)] for end in ("lowest", "highest"))
    return {"measures": {"lowest": lowest, "highest": highest}}


def test_a_model_of_another_body_is_told(model, shot):
    assert _notes(model, shot, _learned(shot)) == []
    # A head 30 mm narrower than all that were learned, and one a millimetre narrower.
    half = body_measures(shot.rigs[0].character)[0]
    (note,) = _notes(model, shot, _learned(shot, lowest={0: half + 0.03}, highest={0: half + 0.04}))
    assert note.startswith(
        "/Hero/Rig: the model was trained on another body: head half width 0.1 m (trained: 0.13 to 0.14)"
    )
    assert _notes(model, shot, _learned(shot, lowest={0: half + 0.001}, highest={0: half + 0.04})) == []
    # Shoulder joints differ by centimetres between rigs of one body.
    arms = body_measures(shot.rigs[0].character)[6]
    assert _notes(model, shot, _learned(shot, highest={6: arms - 0.02})) == []
    (note,) = _notes(model, shot, _learned(shot, highest={6: arms - 0.05}))
    assert "upper arm half distance" in note


def test_inspect_tells_what_a_bake_does(tmp_path, model):
    """It promised what would spoil a bake, and the bake then said more."""
    path = write_shot(tmp_path)
    (note,) = [note for note in bake(path, tmp_path / "hair.usda", frames="1:1").notes if "another body" in note]
    assert note in inspect(path)["spoils"] and note in inspect(tmp_path / "hair.usda")["spoils"]
    bake(path, tmp_path / "mine.usda", model, frames="1:1")
    assert note not in inspect(tmp_path / "mine.usda")["spoils"], "its own model moved it"


def test_a_character_that_the_model_was_trained_on_is_none_that_no_model_knows(model, tmp_path, monkeypatch):
    """Training on it is what that note advises: with such a model it must be gone."""
    monkeypatch.setattr(character_notes, "HIGHEST", np.full(10, 0.01))
    path = write_shot(tmp_path)
    plain, told = StrandModel.load(model).file, []
    for card in ({}, _learned(read_shot(path)), _learned(read_shot(path), highest={1: 0.05})):
        mine = StrandModel(replace(plain, meta=plain.meta | {"training": card}))
        told.append(sum("(trained: " in n for n in bake(path, tmp_path / "hair.usda", mine, frames="1:1").notes))
    assert told == [1, 0, 2]


@pytest.mark.parametrize(
    "measures", [None, 3, "wide", [1], {"lowest": [0.1]}, {"lowest": ["a"] * 10, "highest": [10**400] * 10}]
)
def test_a_card_may_hold_anything(model, shot, measures):
    assert _notes(model, shot, {"measures": measures}) == []
    assert _notes(model, shot, {}) == []


def test_a_material_that_was_never_learned_is_told(model, shot):
    plain = StrandModel.load(model).file
    one = StrandModel(replace(plain, meta=plain.meta | {"training": {"options": {"random_materials": False}}}))
    assert model_notes(one, Material(clumping=0.5), carried(shot)) == [] == model_notes(one, Material(), carried(shot))
    (note,) = model_notes(one, replace(Material(), weight=2 * Material.weight), carried(shot))
    assert "stiffness, weight and damping change nothing" in note


def test_the_shipped_model_does_not_advise_itself(shot):
    """Of a body that no model knows, the shot's notes tell; of others, training helps."""
    plain = StrandModel.load()
    changed = _learned(shot, highest={0: 0.05}, lowest={0: 0.04})
    one = StrandModel(replace(plain.file, meta=plain.meta | {"training": changed}))
    (note,) = model_notes(one, Material(), carried(shot))
    assert note.endswith("if hair moves oddly or lies in the body, train one on this character")
    (note,) = _notes(plain.file.path, shot, changed)
    assert note.endswith("train one on this character") and "use the shipped" not in note


def test_strength_that_a_model_of_held_poses_does_not_feel_is_told(model, shot):
    plain = StrandModel.load(model).file
    still, moving = (StrandModel(replace(plain, meta=plain.meta | {"static": static})) for static in (True, False))
    (note,) = model_notes(still, Material(), carried(shot), strength=2.0)
    assert note.startswith("motion strength: has no effect on a model of held poses")
    assert (
        model_notes(still, Material(), carried(shot))
        == []
        == model_notes(moving, Material(), carried(shot), strength=2.0)
    )
