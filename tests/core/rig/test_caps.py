# SPDX-License-Identifier: Apache-2.0
"""Joints that hold all hair, and turn none of it: those of a cap on the skull, and holders of tails."""

from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig import find_chains
from neuralocks_core.skinned_body import Body
from tests.core.rig.builders import character, ring, skin, steered, tail


def test_a_control_of_the_cap_of_the_hair_is_no_bone():
    """As if the joint drove the cap itself."""
    who, skins = steered("hair")
    del skins["hair_1"]
    meshes = [skin(who, skins), ring(who, "head"), ring(who, "hair_1")]
    names = find_chains(who, meshes).names
    assert names[-2:] == ("phys_2", "phys_3") and "phys_1" not in names


def test_a_joint_that_drives_the_cap_of_the_hair_is_no_bone():
    """If it turned, it would take all hair through the forehead: only the tails below it move."""
    who = character([("Hair", "head", (0, 1.6, 0)), *tail("Hair", 3, parent="Hair")])
    tails = skin(who, {"Hair_1": np.eye(3) * 0.1 + [0, 1.6, -0.1], "Hair_2": np.eye(3) * 0.1 + [0, 1.5, -0.1]})
    head = ring(who, "head")
    assert find_chains(who, [head, tails, ring(who, "Hair", 1.1)]).names == ("Hair_1", "Hair_2")
    assert find_chains(who, [head, tails, ring(who, "Hair", 0.2)]).names == ("Hair", "Hair_1", "Hair_2")
    beside = character([("Hair", "head", (0, 1.6, 0)), *tail("Hair", 3)])
    cap = ring(beside, "Hair", 1.1)
    tails = skin(beside, {f"Hair_{i}": np.eye(3) * 0.1 + [0, 1.7 - 0.1 * i, -0.1] for i in (1, 2)})
    assert find_chains(beside, [ring(beside, "head"), tails, cap]).names == ("Hair_1", "Hair_2")
    alone = character([("Hair", "head", (0, 1.6, 0))])
    with pytest.raises(NeuralocksError, match="'Hair' drives all hair on the skull.*--chains Hair"):
        find_chains(alone, [ring(alone, "head"), ring(alone, "Hair", 1.1)])


def test_a_cap_may_leave_the_forehead_free_and_ears_stand_out():
    """Both are narrower than the head's box; a bun as large as that, behind the head, is a hair bone."""
    who = character([("Hair", "head", (0, 1.6, 0)), *tail("Hair", 3, parent="Hair")])
    tails = skin(who, {"Hair_1": np.eye(3) * 0.1 + [0, 1.6, -0.1], "Hair_2": np.eye(3) * 0.1 + [0, 1.5, -0.1]})
    head, cap = ring(who, "head"), ring(who, "Hair")
    back = replace(cap, points=np.minimum(cap.points, (1, 9, 0.05)))
    ears = replace(head, points=head.points * np.where(np.abs(head.points[:, :1]) > 0.08, (2, 1, 1), 1))
    assert find_chains(who, [head, tails, back]).names == ("Hair_1", "Hair_2")
    assert find_chains(who, [ears, tails, cap]).names == ("Hair_1", "Hair_2")
    bun = replace(cap, points=0.8 * cap.points + [0, 0.3, -0.18])
    assert find_chains(who, [head, tails, bun]).names == ("Hair", "Hair_1", "Hair_2")


@pytest.mark.parametrize("share", [0.5, 0.01])
def test_a_holder_that_smoothed_weights_give_a_share_of_the_roots_is_no_bone(share):
    """One stroke of a smoothing brush must not make a hairdo one chain that swings over the skull."""
    tails = [
        tail(f"{side}_tail", 3, at=(x, 1.6, -0.1), parent="Hair") for side, x in (("l", -0.1), ("m", 0), ("r", 0.1))
    ]
    who = character([("Hair", "head", (0, 1.6, 0)), *sum(tails, [])])
    names = [f"{side}_tail_{i}" for side in "lmr" for i in (1, 2)]
    mesh = skin(who, {name: np.eye(3) * 0.1 + [0, 1.7 - 0.1 * int(name[-1]), -0.1] for name in names})
    holder = np.full_like(mesh.joint_indices, [n.endswith("/Hair") for n in who.skeleton.names].index(True))
    shares = np.where([[name.endswith("_1")] for name in names for _ in range(3)], share, 0.0)
    mesh = replace(
        mesh,
        joint_indices=np.hstack([mesh.joint_indices, holder]),
        joint_weights=np.hstack([mesh.joint_weights - shares, shares]),
    )
    assert sorted(find_chains(who, [mesh]).names) == sorted(names)
    own = skin(who, {"Hair": np.eye(3) * 0.01 + [0, 1.6, 0]})
    assert "Hair" in find_chains(who, [mesh, own]).names


def test_a_cap_is_as_wide_as_the_skull_alone():
    """Not as a muzzle below it, or as the brim of a hat, which is no skin."""
    who = character([("Hair", "head", (0, 1.6, 0)), *tail("Hair", 3, parent="Hair")])
    names = [name.rpartition("/")[2] for name in who.skeleton.names]
    around = 2 * np.pi * np.arange(12) / 12
    circle = np.stack([np.sin(around), 0 * around, np.cos(around)], axis=1)
    rows = [("neck", 1.4, 0.05), ("neck", 1.45, 0.05), ("head", 1.65, 0.25), ("head", 1.74, 0.1), ("head", 1.85, 0.1)]
    rows += [("head", 1.8, 0.11), ("head", 1.8, 0.4)]  # the brim
    points = np.concatenate([radius * circle + [0, height, 0] for _, height, radius in rows])
    here, after = np.arange(12), (np.arange(12) + 1) % 12
    band = np.concatenate([np.stack([here, after, here + 12], 1), np.stack([after, after + 12, here + 12], 1)])
    triangles = np.concatenate([band + 12 * row for row in (0, 1, 2, 3, 5)])
    joints = np.repeat([names.index(name) for name, *_ in rows], 12)[:, None]
    who = replace(who, body=Body(points, triangles, joints, np.ones_like(joints, float)))
    tails = skin(who, {"Hair_1": np.eye(3) * 0.1 + [0, 1.6, -0.1], "Hair_2": np.eye(3) * 0.1 + [0, 1.5, -0.1]})
    assert find_chains(who, [tails, ring(who, "Hair", 1.1)]).names == ("Hair_1", "Hair_2")
    assert find_chains(who, [tails, ring(who, "Hair", 0.5)]).names == ("Hair", "Hair_1", "Hair_2")
