# SPDX-License-Identifier: Apache-2.0
"""The name of a rig, which stands before each of its joints', is no word for hair, nor for a face."""

import numpy as np
import pytest

from neuralocks_core.character import Character, Skeleton
from neuralocks_core.rig import find_chains
from neuralocks_core.rig.mesh_parts import parted
from neuralocks_core.rig.rigging import moving_joints
from tests.core.rig.builders import character, skin, tail

RIGS = ["Kamille_", "LongHair_", "Wig_", "Twist_", "HatsuneMiku_", "FaceRig_", "Crown_", "Ribbon_", "Feather_", "Miku:"]


def _called(prefix, rows):
    who = character(rows)
    names = tuple("/".join(prefix + part for part in name.split("/")) for name in who.skeleton.names)
    return who, Character(Skeleton(names, who.skeleton.parents, who.skeleton.bind))


@pytest.mark.parametrize("prefix", RIGS)
@pytest.mark.parametrize("hair", ["hair", "tail", "bone"])
def test_a_rigs_name_changes_no_chain(prefix, hair):
    """Not the jaw and the tongue, whose animation a bake would replace, nor what rides on hair."""
    rows = [*tail(hair, 4), *tail("jaw", 3, at=(0, 1.5, 0.1)), *tail("tongue", 3, parent="jaw_1", at=(0, 1.5, 0.1))]
    at = np.array(rows[0][2])
    rides = {"hair_twist": tuple(at + [0, -0.03, -0.005])}
    if hair != "bone":  # what is worn shows whether a joint is hair only where no name does
        rides["ribbon"] = (0.1, 1.5, 0)
    rows += [(name, f"{hair}_1", place) for name, place in rides.items()]
    plain, named = _called(prefix, rows)
    moved = (f"{hair}_1", f"{hair}_2", f"{hair}_3")
    lock = {name: np.eye(3) * 0.02 + [0, 1.5, -0.1] for name in (*moved, *rides)}
    meshes = [skin(plain, lock)]
    meshes += [
        skin(plain, {name: np.eye(3) * 0.02 + [0, 1.5, 0.1]}) for name in ("jaw_1", "jaw_2", "tongue_1", "tongue_2")
    ]
    meshes.append(skin(plain, {"hips": np.eye(3), "head": np.eye(3) + 1}))
    expected = find_chains(plain, meshes)
    assert expected.names == moved
    chains = find_chains(named, meshes)
    assert chains.names == tuple(f"{prefix}{name}" for name in expected.names)
    np.testing.assert_array_equal(chains.bones, expected.bones)
    parts = [parted(who, meshes, moving_joints(who.skeleton, chains)) for who in (plain, named)]
    np.testing.assert_equal(*parts)
