# SPDX-License-Identifier: Apache-2.0
"""Chains as rods: masses, stiffnesses and the force at rest, by hand; the longest way along one; whose skin moves with which joint."""

import numpy as np
import pytest

from neuralocks_core.motion import G
from neuralocks_core.rig import find_chains
from neuralocks_core.rig.kinematics import skin_weights
from neuralocks_core.rig.rods import RigMaterial, RodTree

from .builders import branched, character, skin, tail

LENGTH = 0.1


@pytest.mark.parametrize(("way", "supported"), [((0, -1, 0), 0), ((0, 1, 0), 1), ((1, 0, 0), 1)])
def test_a_rod_of_two_bones_is_what_it_is_by_hand(way, supported):
    """Hanging, its tension carries all of its weight; standing or lying, none."""
    chains = find_chains(character(tail("hair", 3, step=LENGTH * np.array(way))))
    rod = RodTree(chains, RigMaterial(bend=0.02, weight=2.0))
    np.testing.assert_allclose(rod.mass, [0.5, 0.25])
    np.testing.assert_allclose(rod.stiffness, 0.02 / np.array([LENGTH / 2, LENGTH]) / (2 * LENGTH))
    np.testing.assert_allclose(rod.support, supported * 2 * G * rod.mass[:, None] * [0, 1, 0], atol=1e-12)
    assert not RodTree(chains, RigMaterial(rest_support=False)).support.any()


def test_bones_of_unlike_lengths_that_branch_are_what_they_are_by_hand():
    """A bone that hangs, two level ones at its end, and one that hangs from each of these: what level bones bear is held up."""
    places = {"a": (0, 1.6, 0), "b": (0, 1.5, 0), "c": (0, 1.5, 0.2), "d": (0.4, 1.5, 0)}
    rows = [(name, over, places[name]) for name, over in zip("abcd", ("head", "a", "b", "b"))]
    ends = [("c_end", "c", (0, 1.2, 0.2)), ("d_end", "d", (0.4, 1.0, 0))]
    chains = find_chains(character([*rows, *ends]), patterns=["a"])
    rod = RodTree(chains, RigMaterial(bend=0.02))
    np.testing.assert_allclose(chains.lengths, [0.1, 0.2, 0.4, 0.3, 0.5])
    mass = np.array([0.1 + 0.2 + 0.4, 0.2 + 0.3, 0.4 + 0.5, 0.3, 0.5]) / 2 / 1.5
    np.testing.assert_allclose(rod.mass, mass)
    beside = np.array([0.1, 0.1 + (0.2 + 0.4) / 2, 0.2 + 0.3, 0.4 + 0.5]) / 2
    np.testing.assert_allclose(rod.stiffness, 0.02 / beside / 1.5)
    borne = G * np.array([0, mass[1] + mass[3], mass[2] + mass[4], 0, 0])
    np.testing.assert_allclose(rod.support, np.outer(borne, [0, 1, 0]), atol=1e-12)


def test_a_chain_is_as_long_as_its_longest_branch():
    fork = [
        *tail("long", 4, at=(0.05, 1.44, 0), parent="hair_2"),
        *tail("short", 2, at=(0.05, 1.5, 0), parent="hair_2"),
    ]
    for branches in (fork, fork[4:] + fork[:4]):
        chains = find_chains(character([*tail("hair", 2), *branches]))
        place = dict(zip(chains.names, chains.origins))
        (end,) = chains.bones[[chains.names[joint] == "long_3" for joint in chains.bone_joint]]
        way = np.array([place["hair_1"], place["hair_2"], place["long_1"], place["long_2"], place["long_3"]])
        wanted = np.linalg.norm(np.diff([*way, way[-1] + end], axis=0), axis=1).sum()
        assert chains.chain_length(0) == pytest.approx(wanted)


def test_skin_of_an_end_moves_with_the_bone_and_other_skin_with_the_head():
    rig = branched()
    skeleton, names = rig.character.skeleton, [name.rsplit("/", 1)[-1] for name in rig.character.skeleton.names]
    joints = [names.index(name) for name in ("hair_a_3", "hair_b_1", "neck", "head")]
    indices, weights = np.array([joints, joints]), np.array([[0.1, 0.2, 0.3, 0.4], [1.0, 0, 0, 0]])
    found = skin_weights(rig.chains, len(names), skeleton.parents, indices, weights)
    wanted = np.zeros((2, len(rig.chains) + 1))
    slots = [1 + rig.chains.names.index(name) for name in ("hair_a_2", "hair_b_1")]
    wanted[:, [0, *slots]] = [[0.7, 0.1, 0.2], [0, 1, 0]]
    np.testing.assert_allclose(found, wanted)
    bare = tail("hair", 2)
    who = character(bare)
    chains = find_chains(who, [skin(who, {name: np.add(at, np.eye(3) * 0.1 - [0, 0.1, 0]) for name, _, at in bare})])
    assert (
        chains.joints[-1] == len(who.skeleton.names) - 1
    )  # the last of all joints moves, and no joint is above the first
    found = skin_weights(chains, len(who.skeleton.names), who.skeleton.parents, np.array([[0]]), np.ones((1, 1)))
    np.testing.assert_array_equal(found, [[1, 0, 0]])
