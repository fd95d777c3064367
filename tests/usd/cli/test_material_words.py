# SPDX-License-Identifier: Apache-2.0
"""What a bake takes for a material."""

import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import ALIASES, RANGES, Material
from usd.baking.bake import as_material

from ..commands import status


def test_words_and_dicts_name_the_same_material():
    assert as_material("stiffness=2x") == as_material({"bend": 2e-3}) == as_material(["bend=0.002"]) == Material(2e-3)
    assert as_material(None) == as_material(()) == Material()


@pytest.mark.parametrize("material", [3, b"bend=2x", [1], [None]])
def test_what_is_no_material_is_refused_in_words(material):
    with pytest.raises(NeuralocksError, match="give a Material, words such as 'bend=2x', or a dict"):
        as_material(material)


def test_help_tells_the_default_and_the_range_of_every_constant(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "300")
    assert status("bake", "--help") == 0
    told = " ".join(capsys.readouterr().out.replace("│", " ").split())
    said = {ours: artists for artists, ours in ALIASES.items()}
    for name, (low, high) in RANGES.items():
        assert f"{said.get(name, name)} {getattr(Material(), name):g} ({low:g}..{high:g})" in told
