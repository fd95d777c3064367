# SPDX-License-Identifier: GPL-3.0-or-later
"""The sliders of strands are those that the core knows, as far as it lets them be moved."""

from dataclasses import fields

import pytest

from dcc_addon.services.panel.sliders import MATERIAL, SLIDERS
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import Material


def test_every_constant_of_the_material_has_a_slider():
    assert [slider.name for slider in MATERIAL] == [field.name for field in fields(Material)]
    assert len({slider.name for slider in SLIDERS}) == len({slider.label for slider in SLIDERS}) == len(SLIDERS)


@pytest.mark.parametrize("slider", MATERIAL, ids=lambda slider: slider.name)
def test_a_slider_ends_where_the_core_does(slider):
    for end in (slider.low, 1.0, slider.high):
        Material.parse([f"{slider.name}={end:.9g}x"])
    with pytest.raises(NeuralocksError):
        Material.parse([f"{slider.name}={slider.high + 1e-3:.9g}x"])
