# SPDX-License-Identifier: Apache-2.0
"""How far the hairs of a lock part: what the law says of hair whose answer is known."""

import numpy as np
import pytest

from neuralocks_core.deformation.clumping import Locks
from neuralocks_core.materials import RANGES, Material
from neuralocks_core.strands.strand_set import K, StrandSet

LENGTHS = np.array([0.02, 0.1, 0.3, 0.6])


@pytest.fixture(scope="module")
def locks():
    """Hanging hairs of four lengths in one lock."""
    count = len(LENGTHS)
    rest = np.zeros((count, K, 3), np.float32)
    rest[:, :, 1] = -np.linspace(0, 1, K) * LENGTHS[:, None]
    frames = np.broadcast_to(np.eye(3, dtype=np.float32), (count, 3, 3))
    valid, lock, uv = np.ones(count, bool), np.zeros(count, np.int32), np.full((count, 2), 0.5, np.float32)
    length = LENGTHS.astype(np.float32)
    return Locks.of(StrandSet(rest, valid, uv, frames, lock, length, np.zeros(3), np.zeros(3), np.eye(3)))


def of(locks, **material):
    return locks.spread(Material(**material).log_ratios())


def test_the_default_changes_nothing(locks):
    assert (of(locks) == 1).all()
    assert (of(locks, bend=5e-3, weight=0.5) == 1).all()


def test_more_clumping_always_binds_more(locks):
    factors = np.array([of(locks, clumping=c) for c in np.linspace(*RANGES["clumping"], 9)])
    assert (np.diff(factors, axis=0) < 0).all()


def test_ties_hardly_act_on_short_hair_and_are_what_holds_long_hair(locks):
    loose, bound = of(locks, clumping=0.0), of(locks, clumping=240.0)
    assert loose[0] == pytest.approx(1, abs=0.02) and bound[0] == pytest.approx(1, abs=0.06)
    assert (np.diff(loose) > 0).all() and (np.diff(bound) < 0).all()
    assert loose[-1] == pytest.approx(1 + 120 / (9.81 / 0.6), rel=0.01)  # a pendulum, as good as without stiffness


def test_what_is_stiffer_or_heavier_feels_its_ties_less(locks):
    for change in ({"bend": 5e-3}, {"weight": 2.0}):
        for clumping in (0.0, 240.0):
            own, more = (np.abs(np.log(of(locks, clumping=clumping, **c))) for c in ({}, change))
            assert (more < own).all()
