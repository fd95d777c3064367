# SPDX-License-Identifier: Apache-2.0
"""Posing hair from Python, as a bake does it."""

from inspect import signature

from usd.baking.bake import bake
from usd.baking.points.posing import GroomPoser


def test_what_is_left_out_is_as_in_a_bake():
    poser, baked = (signature(each).parameters for each in (GroomPoser, bake))
    alike = poser.keys() & baked.keys() - {"model"}
    assert {"resolve", "strength", "loop", "wind", "material"} <= alike
    assert {name: poser[name].default for name in alike} == {name: baked[name].default for name in alike}
