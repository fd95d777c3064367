# SPDX-License-Identifier: Apache-2.0
"""Compiled code carries a deformation to a groom's own vertices as numpy does, bit for bit."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from neuralocks_core.deformation import carrier
from neuralocks_core.deformation.carrier import Carrier, Placing
from neuralocks_core.groom import Groom
from neuralocks_core.native.carry import Carry
from neuralocks_core.native.library import library
from neuralocks_core.strands.strand_set import strand_set
from tests.core.strands.odd_grooms import CENTRE, ORIGIN, coil_groom, ragged_groom

pytestmark = pytest.mark.skipif(library() is None, reason="there is no compiled library for this machine")


def straight_groom():
    way = np.linspace(0, 1, 24)[None, :, None] * np.random.default_rng(1).normal(size=(50, 1, 3))
    return Groom("/straight", (ORIGIN + 0.1 + 0.2 * way).reshape(-1, 3).astype(np.float32), np.full(50, 24))


@pytest.mark.parametrize("facing", [None, Rotation.from_euler("y", -70, degrees=True).as_matrix()])
@pytest.mark.parametrize("make", [straight_groom, ragged_groom, coil_groom])
def test_strands_are_carried_the_same(make, facing, monkeypatch):
    groom = make()
    strands = strand_set(groom, ORIGIN, CENTRE, facing)
    compiled = Carrier(groom, strands)
    monkeypatch.setattr(Carry, "serves", lambda vertices: False)
    plain = carrier.Carrier(groom, strands)
    assert compiled._compiled is not None and plain._compiled is None
    displacement = np.random.default_rng(0).normal(size=strands.rest.shape).astype(np.float32) * 0.02
    displacement[::5] = 0
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = Rotation.from_euler("xyz", [0.3, 1, -2]).as_matrix() * 1.5, [3, 4, 5]
    placing = Placing.of(transform, ORIGIN)
    for where in ({}, {"placing": placing}, {"placing": placing, "onto": groom.points}):
        found, wanted = (each.carry(displacement, **where) for each in (compiled, plain))
        assert found.tobytes() == wanted.tobytes() and np.isfinite(found).all()
        some = slice(7, 19)
        part = compiled.carry(displacement[some], strands=some, **where)
        ends = np.append(groom.starts, len(groom.points))
        np.testing.assert_array_equal(part, found[ends[7] : ends[19]])
