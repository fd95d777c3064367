# SPDX-License-Identifier: Apache-2.0
"""Whether a character lies in its bind pose."""

import numpy as np
import pytest

from neuralocks_core.anatomy.humanoid import Humanoid
from neuralocks_core.anatomy.standing import lies

NAMED = {"hips": 0, "head": 1, "left_foot": 2, "right_foot": 3}
UPRIGHT = np.array([[0, 1, 0], [0, 1.6, 0.05], [0.2, 0.1, 0], [-0.2, 0.1, 0]])
FLAT = UPRIGHT[:, [0, 2, 1]]
ON_ALL_FOURS = np.array([[0, 1, 0], [0, 1.1, 1], [0.2, 0.1, 0], [-0.2, 0.1, 0]])
SEATED = np.array([[0, 0.1, 0], [0, 0.7, 0], [0.2, 0.1, 0.9], [-0.2, 0.1, 0.9]])


@pytest.mark.parametrize("joints, lying", [(UPRIGHT, False), (FLAT, True), (ON_ALL_FOURS, False), (SEATED, False)])
def test_legs_and_trunk_lie(joints, lying):
    assert lies(joints, Humanoid(NAMED), np.array([0, 1, 0])) == (lying, True)


def test_without_legs_a_level_trunk_may_be_an_animals():
    trunk = Humanoid({"hips": 0, "head": 1})
    assert lies(ON_ALL_FOURS, trunk, np.array([0, 1, 0])) == (True, False)
    assert lies(UPRIGHT, trunk, np.array([0, 1, 0])) == (False, False)
    assert not lies(UPRIGHT[:1], Humanoid({"head": 0}), np.array([0, 1, 0]))[0]
