# SPDX-License-Identifier: Apache-2.0
"""Chains that may be hair, beside those that names tell."""

import numpy as np

from neuralocks_core.rig import find_chains
from neuralocks_core.rig.finding import left_out
from tests.core.rig.builders import character, skin, tail


def test_rows_of_joints_that_no_name_tells_are_left_out():
    """Not those of a face or below one, nor short ones, nor those below a chain; for a holder, those below it."""
    rows = [*tail("hair", 2), *tail("cable", 3, parent="hair_2"), ("all", "head", (0, 1.6, 0))]
    rows += [*tail("cord", 3, parent="all"), *tail("rope", 4, parent="all"), *tail("stub", 2), *tail("tongue", 3)]
    rows += [("jaw", "head", (0, 1.5, 0.1)), *tail("whip", 3, parent="jaw"), *tail("bare", 3)]
    who = character(rows)
    point = np.eye(3) * 0.1 + [0, 1.6, -0.1]
    driven = [name for name, *_ in rows if name != "all" and not name.startswith("bare")]
    meshes = [skin(who, dict.fromkeys(["hips", *driven], point))]
    found = left_out(who, meshes, find_chains(who, meshes))
    assert [who.skeleton.names[joint].rpartition("/")[2] for joint in found] == ["cord_1", "rope_1"]
