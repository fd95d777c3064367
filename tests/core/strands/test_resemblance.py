# SPDX-License-Identifier: Apache-2.0
"""How far hair lies from hair that a model has learned."""

from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.strands.resemblance import KEPT, LOOKED_AT, Learned, learned_hair
from neuralocks_core.strands.strand_set import strand_set
from tests.core.strands.odd_grooms import CENTRE, ORIGIN, ragged_groom

STRANDS = strand_set(ragged_groom(), ORIGIN, CENTRE)


def test_hair_is_as_far_as_it_is_moved():
    learned = Learned(learned_hair([STRANDS]))
    assert learned.distance(STRANDS) < 0.001  # a card holds whole millimetres
    aside = np.array([0.03, 0.04, 0.0], np.float32)
    far = Learned(learned_hair([STRANDS.subset(np.flatnonzero(STRANDS.valid)[:1])]))
    one = STRANDS.subset(np.flatnonzero(STRANDS.valid)[:1])
    assert far.distance(one.carried(aside)) == pytest.approx(0.05, abs=0.001)


def test_hair_on_another_head_is_compared_from_the_middle_of_that():
    far = np.array([0.0, 0.4, 0.3])
    other = replace(STRANDS.carried(far.astype(np.float32)), head_centre=STRANDS.head_centre + far)
    assert Learned(learned_hair([STRANDS])).distance(other) < 0.001


def test_half_of_the_strands_decide():
    learned = Learned(learned_hair([STRANDS]))
    usable = np.flatnonzero(STRANDS.valid)
    for share, near in ((0.4, True), (0.6, False)):
        offset = np.zeros((len(STRANDS.rest), 1, 3), np.float32)
        offset[usable[: int(share * len(usable))]] = 1.0
        assert (learned.distance(STRANDS.carried(offset)) < 0.001) == near


def test_a_card_holds_as_many_strands_of_each_groom():
    few = STRANDS.subset(np.flatnonzero(STRANDS.valid)[:20])
    assert len(learned_hair([few, few])) == 40
    many = STRANDS.subset(np.tile(np.flatnonzero(STRANDS.valid), 30))
    told = learned_hair([many, many, many])
    assert KEPT - 3 <= len(told) <= KEPT
    assert max(map(len, told)) < 6 * 3 * len(LOOKED_AT)


def test_hair_without_length_is_like_nothing():
    assert Learned(learned_hair([STRANDS])).distance(replace(STRANDS, valid=np.zeros_like(STRANDS.valid))) == np.inf


@pytest.mark.parametrize(
    "told",
    [
        None,
        3,
        "1 2 3",
        [],
        {},
        [3],
        ["1 2 3"],
        ["a " * 24],
        ["1e9 " * 24],
        ["1 " * 24] * 10_001,
        [str(10**9) + " 0" * 23],
        [str(10**400) + " 0" * 23],
    ],
)
def test_a_card_may_hold_anything(told):
    with pytest.raises(ValueError):
        Learned(told)
