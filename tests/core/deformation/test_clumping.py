# SPDX-License-Identifier: Apache-2.0
"""How far the hairs of a lock part: what the law says of hair whose answer is known."""

import numpy as np
import pytest
from scipy.optimize import brentq

from neuralocks_core.boundary.history import BoundarySampler
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.deformation.clumping import Locks
from neuralocks_core.materials import RANGES, Material
from neuralocks_core.models.network_sizes import K
from neuralocks_core.strands.strand_set import StrandSet
from tests.core.rigs import moved, person

LENGTHS = np.array([0.02, 0.1, 0.3, 0.6])
EACH = 6
"""Number of hairs of each length, all tied to each other."""


@pytest.fixture(scope="module")
def locks():
    """Hanging hairs of four lengths, a lock of each, some millimetres apart."""
    length = np.repeat(LENGTHS, EACH)
    count = len(length)
    rest = np.zeros((count, K, 3), np.float32)
    rest[:, :, 1] = -np.linspace(0, 1, K) * length[:, None]
    rest[:, :, 0] = 0.05 * np.repeat(np.arange(len(LENGTHS)), EACH)[:, None]
    rest[:, :, ::2] += np.random.default_rng(0).normal(0, 0.002, (count, 1, 2))
    frames = np.broadcast_to(np.eye(3, dtype=np.float32), (count, 3, 3))
    valid, lock, uv = np.ones(count, bool), np.zeros(count, np.int32), np.full((count, 2), 0.5, np.float32)
    zero, length = np.zeros(3), length.astype(np.float32)
    return Locks.of(StrandSet(rest, valid, uv, frames, lock, length, zero, zero, np.eye(3)))


def of(locks, **material):
    """The factor of one hair of each length."""
    spec = BoundarySpec()
    vector = BoundarySampler(spec, person(), moved([0.0])).held_bind(Material(**material).log_ratios())
    return locks.spread(vector[spec.slices["material"]])[::EACH]


def test_a_lock_is_what_ties_join(locks):
    assert len(np.unique(locks.lock)) == len(np.unique(locks.lock[::EACH])) == len(LENGTHS)
    np.testing.assert_allclose(
        np.square(locks.tie), EACH / (EACH - 1), rtol=1e-4
    )  # from the mean of the others, not of all


def test_a_hair_is_as_stiff_as_a_rod_that_is_held_at_one_end(locks):
    """Its lowest mode is at the first root x of cos x cosh x = -1, and x^4 B / L^4 is its stiffness per mass."""
    root = brentq(lambda x: np.cos(x) * np.cosh(x) + 1, 1, 3)
    np.testing.assert_allclose(locks.rod[::EACH], root**4 / LENGTHS**4, rtol=1e-3)


def test_a_hair_that_nothing_ties_goes_its_own_way(locks):
    """Guide hairs may have no neighbour within reach; and a wide lock of direct neighbours resists little when it parts."""
    far = np.arange(6)[:, None, None] * np.array([1.0, 0, 0])

    def law(apart):
        rest = (locks.rest[-6:] * [0, 1, 0] + apart * far).astype(np.float32)
        one = np.zeros(6, np.int32)
        frames, uv, zero = np.broadcast_to(np.eye(3, dtype=np.float32), (6, 3, 3)), np.full((6, 2), 0.5), np.zeros(3)
        strands = StrandSet(rest, np.ones(6, bool), uv, frames, one, np.full(6, 0.6), zero, zero, np.eye(3))
        found = Locks.of(strands)
        return found, found.spread(Material(clumping=0.0).log_ratios())

    found, factor = law(0.03)
    assert len(np.unique(found.lock)) == 6 and (factor == 1).all()
    near, wide = law(0.003)[0], law(0.015)[0]
    assert not near.lock.any() and not wide.lock.any()
    assert 0 < wide.tie[0] < 0.7 < near.tie[0]


@pytest.mark.parametrize("clumping", RANGES["clumping"])
def test_ties_move_hairs_within_their_lock_and_not_the_lock(locks, clumping):
    """Hair that is swung sideways by one angle as a whole, and a little by each hair's own."""
    own = np.random.default_rng(1).normal(0, 0.003, len(locks.lock))
    angle = (0.03 + own) * (np.linspace(0, 1, K) > 1.5 / K)[:, None]
    edges = np.diff(locks.rest, axis=1)
    turned = np.stack(
        [-np.sin(angle[1:].T) * edges[..., 1], np.cos(angle[1:].T) * edges[..., 1], edges[..., 2]], axis=-1
    )
    moved = np.zeros_like(locks.rest)
    moved[:, 1:] = np.cumsum(turned - edges, axis=1)
    after = locks.gather(moved.reshape(len(moved), -1), Material(clumping=clumping).log_ratios())(slice(None))
    ways, strays = [], []
    for each in (moved, after.reshape(moved.shape)):
        means = each.reshape(len(LENGTHS), EACH, K, 3).mean(axis=1)
        ways.append(means)
        strays.append((each - np.repeat(means, EACH, axis=0))[:, -1, 0].reshape(len(LENGTHS), EACH))
    np.testing.assert_allclose(strays[1], strays[0] * of(locks, clumping=clumping)[:, None], rtol=0.03)
    assert np.abs(ways[1] - ways[0]).max() < 0.02 * np.abs(strays[1] - strays[0]).max()


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
    assert loose[-1] == pytest.approx(
        1 + np.sqrt(1.2) * 120 / (9.81 / 0.6), rel=0.01
    )  # a pendulum, as good as without stiffness


def test_what_is_stiffer_or_heavier_feels_its_ties_less(locks):
    for change in ({"bend": 5e-3}, {"weight": 2.0}):
        for clumping in (0.0, 240.0):
            own, more = (np.abs(np.log(of(locks, clumping=clumping, **c))) for c in ({}, change))
            assert (more < own).all()
