# SPDX-License-Identifier: Apache-2.0
"""Parents of joints are read from their paths."""

import numpy as np

from usd.skel.joint_parents import joint_parents


def test_the_parent_is_the_nearest_joint_above():
    found = joint_parents("/Rig", ["root", "root/twist/neck", "root/twist/neck/head", "tail"])
    np.testing.assert_array_equal(found, [-1, 0, 1, -1])


def test_no_joints_have_no_parents_to_index_by():
    assert np.arange(3)[joint_parents("/Rig", [])].shape == (0,)
