# SPDX-License-Identifier: Apache-2.0
"""The four numbers of a material: what is taken, what is refused in words, what the network reads."""

import numpy as np
import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import RANGES, Material, constants


def test_the_network_reads_zeros_for_the_default():
    assert not Material().log_ratios().any()


@pytest.mark.parametrize("clumping", [0.0, 7.0, 240.0])
def test_constants_are_those_whose_ratios_are_given(clumping):
    back = constants(Material(3e-4, 1.7, 5.0, clumping).log_ratios())
    assert back == pytest.approx((3e-4, 1.7, 5.0, clumping), rel=1e-5, abs=1e-5) and back[3] >= 0


@pytest.mark.parametrize("name", RANGES)
def test_ends_of_a_range_are_taken_and_what_lies_beyond_is_refused(name):
    low, high = RANGES[name]
    # A slider holds its factor in single precision.
    for value in (low, high, np.float32(low), np.float32(high / getattr(Material(), name)) * getattr(Material(), name)):
        material = Material(**{name: value})
        assert np.isfinite(material.log_ratios()).all()
        assert type(getattr(material, name)) is float  # a bake writes it to JSON and USD
    for value in (low - 1e-3 * high, 1.001 * high, np.inf, np.nan):
        with pytest.raises(NeuralocksError, match=f"material {name}: .* is outside {low:g} to {high:g}"):
            Material(**{name: value})


def test_random_materials_are_the_default_or_anywhere_in_their_ranges():
    """Each constant by itself, and evenly over the logarithm that the network reads."""
    rng = np.random.default_rng(0)
    drawn = [Material.random(rng) for _ in range(600)]
    for row, (name, (low, high)) in enumerate(RANGES.items()):
        default = np.array([getattr(each, name) == getattr(Material(), name) for each in drawn])
        assert default.mean() == pytest.approx(1 / 3, abs=0.07), name
        ends = [Material(**{name: end}).log_ratios()[row] for end in (low, high)]
        share = (np.array([each.log_ratios()[row] for each in drawn])[~default] - ends[0]) / (ends[1] - ends[0])
        assert np.percentile(share, [5, 25, 50, 75, 95]) == pytest.approx([0.05, 0.25, 0.5, 0.75, 0.95], abs=0.07), name


@pytest.mark.parametrize("value", ["1", None, True, [1.0]])
def test_what_is_no_number_is_refused_in_words(value):
    with pytest.raises(NeuralocksError, match="material bend: .* is not a number; give one from 0.0002 to 0.005"):
        Material(bend=value)


@pytest.mark.parametrize("setting", ["weight=1 damping=4", "weight=1,damping=4"])
def test_several_in_one_word_are_told_apart(setting):
    with pytest.raises(NeuralocksError, match="more than one NAME=VALUE; give each by itself"):
        Material.parse([setting])


def test_what_is_no_word_is_refused():
    with pytest.raises(NeuralocksError, match="material 1: is not a word; write NAME=VALUE"):
        Material.parse([1])


@pytest.mark.parametrize("settings", [["weight=1.5", "weight=2"], ["stiffness=2x", "bend=0.002"]])
def test_a_constant_is_given_once(settings):
    with pytest.raises(NeuralocksError, match=f"material '{settings[1]}': (weight|bend) is given twice"):
        Material.parse(settings)


@pytest.mark.parametrize("setting", ["stiffness=0", "stiffness = 100x", "stiffness=soft"])
def test_words_are_told_as_they_were_said(setting):
    with pytest.raises(NeuralocksError, match="stiffness") as caught:
        Material.parse([setting])
    assert "bend" not in str(caught.value)
