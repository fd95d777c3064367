# SPDX-License-Identifier: Apache-2.0
"""Chains that may be hair, beside those that names tell."""

from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.rig import find_chains
from neuralocks_core.rig.chain_finding import left_out
from tests.core.rig.builders import character, ring, skin, tail


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


def _left(rows, bodies=()):
    """Left out of a rig whose rows have each a mesh of its own, but for those in the body's, beside hair."""
    who = character([*tail("hair", 3), *rows])
    point = np.eye(3) * 0.1 + [0, 1.6, -0.1]
    names = [name for name, *_ in rows if not name.startswith("bare")]
    meshes = [skin(who, {name: point}) for name in names if name not in bodies]
    meshes += [
        skin(who, dict.fromkeys(["hair_1", "hair_2"], point)),
        skin(who, dict.fromkeys(["hips", *bodies], point)),
    ]
    found = left_out(who, meshes, find_chains(who, meshes))
    return [who.skeleton.names[joint].rpartition("/")[2] for joint in found]


@pytest.mark.parametrize(
    "name", "Beard Moustache_L Ribbon HairRibbon CatEar_L Veil Scarf Antenna_L Feather Pendant ひげ".split()
)
def test_rows_of_what_a_face_has_or_wears_are_left_out(name):
    """Also below a jaw, and in a holder; not short ones, nor what is in the body's mesh."""
    rows = tail(name, 3)
    assert _left(rows) == [f"{name}_1"]
    assert _left([("jaw", "head", (0, 1.5, 0.1)), *tail(name, 3, parent="jaw")], ["jaw"]) == [f"{name}_1"]
    assert _left([(f"bare_{name}", "head", (0, 1.5, 0.1)), *tail(name, 3, parent=f"bare_{name}")]) == [f"{name}_1"]
    assert _left(rows[:2]) == [] and _left(rows, [f"{name}_3"]) == []


@pytest.mark.parametrize("name", "jaw tongue Eye_L lid_upper Ear_L elfEar_R FaceRig 舌 耳".split())
def test_rows_of_the_face_itself_are_not_left_out(name):
    assert _left(tail(name, 4)) == []


def test_what_is_worn_on_hair_that_moves_is_not_left_out():
    assert _left(tail("ribbon", 3, parent="hair_2")) == []


def test_a_single_joint_in_the_mesh_of_hair_is_left_out():
    """Not one with a mesh of its own, a button, nor one in a mesh of the body."""
    who = character([*tail("hair", 3), ("wisp", "head", (0.1, 1.6, 0)), ("button", "head", (0.1, 1.6, 0.1))])
    point = np.eye(3) * 0.1 + [0, 1.6, -0.1]
    hair, body = dict.fromkeys(["hair_1", "hair_2", "wisp"], point), {"hips": point, "head": point}
    for meshes, expected in (([hair, {"button": point}, body], ["wisp"]), ([hair | body, {"button": point}], [])):
        meshes = [skin(who, mesh) for mesh in meshes]
        found = left_out(who, meshes, find_chains(who, meshes))
        assert [who.skeleton.names[joint].rpartition("/")[2] for joint in found] == expected


def test_the_joint_of_a_cap_in_the_mesh_of_hair_is_not_left_out():
    """It stays still on purpose."""
    who = character([*tail("hair", 3), ("scalp", "head", (0, 1.6, 0))])
    tails = skin(who, dict.fromkeys(["hair_1", "hair_2"], np.eye(3) * 0.1 + [0, 1.6, -0.1]))
    for size, left in ((1.0, []), (0.3, ["scalp"])):
        cap = ring(who, "scalp", size)
        together = {
            name: np.concatenate([getattr(mesh, name) for mesh in (tails, cap)])
            for name in ("points", "joint_indices", "joint_weights")
        }
        meshes = [ring(who, "head"), replace(tails, **together)]
        found = left_out(who, meshes, find_chains(who, meshes))
        assert [who.skeleton.names[joint].rpartition("/")[2] for joint in found] == left
