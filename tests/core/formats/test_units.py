# SPDX-License-Identifier: Apache-2.0
"""What users may write for a unit and an axis, for every kind of file alike."""

import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.formats.units import metres_per_unit, upward_axis


@pytest.mark.parametrize(
    ("unit", "metres"), [("cm", 0.01), ("CM", 0.01), (" in", 0.0254), ("0.5", 0.5), (2.0, 2.0), ("m", 1.0)]
)
def test_names_and_numbers_are_metres(unit, metres):
    assert metres_per_unit(unit) == metres


@pytest.mark.parametrize("unit", ["", "yard", "0", "-1", "nan", "inf", "1e9", "1_0", "\uff11\uff10", None, [], 10**400])
def test_what_is_no_unit_is_said_with_those_that_are(unit):
    with pytest.raises(NeuralocksError, match="give mm, cm, m, in, or metres"):
        metres_per_unit(unit)


def test_axes_come_in_either_case():
    assert (upward_axis("y"), upward_axis("Z")) == ("Y", "Z")
    with pytest.raises(NeuralocksError, match="give Y or Z"):
        upward_axis("X")
