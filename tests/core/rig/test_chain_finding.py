# SPDX-License-Identifier: Apache-2.0
"""Chains are found by themselves on rigs of any naming."""

import numpy as np
import pytest

from neuralocks_core.character import Character, Skeleton
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig import find_chains
from neuralocks_core.rig.measuring import placed_chains
from neuralocks_core.rotation import from_vector
from tests.core.rig.builders import character, skin, steered, tail


def test_chains_by_name_with_end_joints():
    """The last joint of each chain drives nothing: it is a bone's end and does not move."""
    who = character([*tail("Hair_L", 3), *tail("Hair_R", 2), ("Eye_L", "head", (0.03, 1.6, 0.1))])
    chains = find_chains(who)
    assert chains.names == ("Hair_L_1", "Hair_L_2", "Hair_R_1")
    assert list(chains.parents) == [-1, 0, -1] and list(chains.chain) == [0, 0, 1]
    assert chains.chain_length(0) == pytest.approx(2 * np.hypot(0.06, 0.01))


def test_without_meshes_a_fan_of_two_is_held_by_no_bone():
    rows = [
        ("hair_all", "head", (0, 1.6, 0)),
        *tail("hair_a", 2, parent="hair_all"),
        *tail("hair_b", 2, parent="hair_all"),
    ]
    assert find_chains(character(rows)).tops == ["hair_a_1", "hair_b_1"]


def test_strange_names_are_found_by_what_they_drive():
    """A subtree that drives only its own mesh is hair; the jaw and joints that drive the body's mesh are not."""
    who = character([*tail("J_opt_C_01", 2), *tail("jaw", 2, at=(0, 1.5, 0.1)), *tail("cable", 2, at=(0.1, 1.6, 0))])
    lock = skin(who, {"J_opt_C_01_1": np.eye(3) * 0.1 + [0, 1.6, -0.1]})
    body = skin(who, {"hips": np.eye(3), "head": np.eye(3) + 1, "cable_1": np.eye(3)})
    jaw = skin(who, {"jaw_1": np.eye(3)})
    assert find_chains(who, [lock, body, jaw]).names == ("J_opt_C_01_1",)


@pytest.mark.parametrize("name", ["hair_group", "head_twist"])
def test_a_holder_that_drives_nothing_is_no_bone(name):
    """Whatever its name, and with one child or several: turning it would swing the hair's roots through the skull."""
    holder = (name, "head", (0, 1.6, -0.1))
    who = character([holder, *tail("hair", 3, parent=name)])
    meshes = [skin(who, {"hair_1": np.eye(3) * 0.1 + [0, 1.6, -0.1], "hair_2": np.eye(3) * 0.1 + [0, 1.5, -0.1]})]
    assert find_chains(who, meshes).names == ("hair_1", "hair_2")


@pytest.mark.parametrize("patterns", [None, ["phys_1"]])
def test_a_chain_of_controls_with_deforming_joints_beside_them_is_one_chain(patterns):
    """As separate chains, each would turn about its own pivot, and the skin would gape."""
    who, skins = steered("hair")
    chains = find_chains(who, [skin(who, skins)], patterns)
    assert chains.names == ("phys_1", "phys_2", "phys_3") and list(chains.parents) == [-1, 0, 1]
    assert chains.chain_length(0) == pytest.approx(3 * np.hypot(0.06, 0.01))


@pytest.mark.parametrize("patterns", [None, ["off_1"], ["phys_1"]])
@pytest.mark.parametrize("leaf_bones", [False, True])
def test_a_chain_of_controls_goes_on_through_offsets_and_leaf_bones(patterns, leaf_bones):
    """Hand-made rigs have an offset above each control, and FBX exporters an end joint below each deforming one."""
    who, skins = steered("hair")
    at = {name.rpartition("/")[2]: tuple(bind[:3, 3]) for name, bind in zip(who.skeleton.names, who.skeleton.bind)}
    rows, above = [], "head"
    for i in (1, 2, 3):
        rows += [(f"off_{i}", above, at[f"phys_{i}"]), (f"phys_{i}", f"off_{i}", at[f"phys_{i}"])]
        rows.append((f"hair_{i}", f"phys_{i}", at[f"hair_{i}"]))
        if leaf_bones:
            rows.append((f"hair_{i}_end", f"hair_{i}", tuple(np.add(at[f"hair_{i}"], (0.05, 0, 0)))))
        above = f"phys_{i}"
    who = character(rows)
    chains = find_chains(who, [skin(who, skins)], patterns)
    assert chains.names == ("phys_1", "phys_2", "phys_3") and list(chains.parents) == [-1, 0, 1]
    assert chains.chain_length(0) == pytest.approx(3 * np.hypot(0.06, 0.01))
    assert list(placed_chains(chains, who).parents) == [-1, 0, 1]


@pytest.mark.parametrize("patterns", [None, ["hair_control"], ["hair_1"]])
def test_a_chain_below_a_control_at_its_place_begins_with_its_own_first_joint(patterns):
    """That joint goes on, so it does not ride on the control."""
    who = character([("hair_control", "head", (0, 1.6, -0.1)), *tail("hair", 4, parent="hair_control")])
    skins = {f"hair_{i}": np.eye(3) * 0.02 + [0, 1.66 - 0.06 * i, -0.1] for i in (1, 2, 3)}
    assert find_chains(who, [skin(who, skins)], patterns).names == ("hair_1", "hair_2", "hair_3")


@pytest.mark.parametrize(("share", "side"), [(0.25, "hair_side"), (0.5, "hair_side"), (0.5, "twisted_lock")])
def test_twist_joints_ride_on_the_bone_that_they_lie_on(share, side):
    """Turned by themselves, they would tear the skin off the next joint; one that lies beside the bone is a lock, whatever its name."""
    rows = tail("hair", 4)
    at = [np.array(place) for _, _, place in rows]
    twists = [(f"hair_{i + 1}_twist", f"hair_{i + 1}", tuple(at[i] + share * (at[i + 1] - at[i]))) for i in (0, 1)]
    beside = (side, "hair_2", tuple(at[1] + [0.001, -0.02, 0]))
    who = character([*rows, *twists, beside, (f"{side}_end", side, tuple(at[1] + [0.02, -0.06, 0]))])
    names = ("hair_1", "hair_2", "hair_3", "hair_1_twist", "hair_2_twist", side)
    skins = {name: np.eye(3) * 0.02 + [0, 1.5, -0.1] for name in names}
    assert find_chains(who, [skin(who, skins)]).names == ("hair_1", "hair_2", "hair_3", side)


@pytest.mark.parametrize("tie", ["hair_tie", "HairBand_L", "ribbon_1", "flower"])
@pytest.mark.parametrize("patterns", [None, ["pony_1"]])
def test_hair_goes_on_from_what_ties_it(tie, patterns):
    rows = tail("pony", 5)
    rows = [(tie if name == "pony_2" else name, tie if parent == "pony_2" else parent, at) for name, parent, at in rows]
    who = character([*rows, ("temple_L", "pony_1", (0.1, 1.5, 0)), ("temple_L_2", "temple_L", (0.1, 1.4, 0))])
    names = ("pony_1", tie, "pony_3", "pony_4", "temple_L", "temple_L_2")
    skins = {name: np.eye(3) * 0.03 + [0, 1.62 - 0.06 * i, -0.1] for i, name in enumerate(names)}
    assert find_chains(who, [skin(who, skins)], patterns).names == names


@pytest.mark.parametrize("at_once", [True, False], ids=["from_one_point", "in_a_row"])
def test_strands_of_one_joint_do_not_take_each_other_for_twist_joints(at_once):
    rows, ways = tail("hair", 3)[:2], [(-0.05, -0.1, 0), (0.05, -0.1, 0), (0.0, -0.1, 0.05)]
    for i, way in enumerate(ways):
        place = np.add(rows[1][2], (0 if at_once else 0.02 * (i + 1), -0.05, 0) if at_once else (0.02 * (i + 1), 0, 0))
        rows += [(f"tip_{i}", "hair_2", tuple(place)), (f"tip_{i}_end", f"tip_{i}", tuple(place + way))]
    who = character(rows)
    names = ("hair_1", "hair_2", "tip_0", "tip_1", "tip_2")
    skins = {name: np.eye(3) * 0.05 + [0, 1.5, -0.1] for name in names}
    assert find_chains(who, [skin(who, skins)]).names == names


@pytest.mark.parametrize("tie_has_skin", [True, False])
def test_a_tail_of_one_joint_goes_on_from_its_tie(tie_has_skin):
    rows = [
        (name.replace("hair_2", "hair_tie"), above.replace("hair_2", "hair_tie"), at)
        for name, above, at in tail("hair", 4)
    ]
    who = character(rows)
    names = ["hair_1", "hair_3"] + ["hair_tie"] * tie_has_skin
    chains = find_chains(who, [skin(who, {name: np.eye(3) * 0.05 + [0, 1.5, -0.1] for name in names})])
    assert chains.names == ("hair_1", "hair_tie", "hair_3")


def test_a_pin_that_is_named_is_hair():
    pin = [("HairPin_L", "hair_1", (0.05, 1.5, -0.1)), ("HairPin_end", "HairPin_L", (0.05, 1.45, -0.1))]
    who = character([*tail("hair", 3), *pin])
    skins = {name: np.eye(3) * 0.05 + [0, 1.55, -0.1] for name in ("hair_1", "hair_2", "HairPin_L")}
    for patterns, own in ((None, False), (["hair_1"], False), (["hair_1", "HairPin*"], True)):
        assert ("HairPin_L" in find_chains(who, [skin(who, skins)], patterns).names) == own


@pytest.mark.parametrize("sides", [(), ("left",), ("left", "right")])
def test_end_joints_that_an_exporter_adds_make_no_hair_of_a_pipe(sides):
    """An end joint shows that a joint of a strange name is a bone, unless all last joints have one."""
    rows = [("pipe", "head", (0, 1.5, 0.1)), ("pipe_end", "pipe", (0, 1.5, 0.2))]
    rows += [(f"{s}_end", f"{s}_lower_arm", (0.6 if s == "left" else -0.6, 1.4, 0)) for s in sides]
    who = character([*rows, *tail("hair", 2)])
    points = np.eye(3) * 0.1 + [0, 1.6, -0.1]
    arms = dict.fromkeys(("chest", "left_lower_arm", "right_lower_arm"), points)
    found = find_chains(who, [skin(who, {"pipe": points}), skin(who, {"hair_1": points}), skin(who, arms)]).names
    assert found == (("hair_1",) if len(sides) == 2 else ("pipe", "hair_1"))


@pytest.mark.parametrize("named", ["hair", "cable"])
@pytest.mark.parametrize("leaf_bones", [False, True])
def test_a_bone_in_the_mesh_of_hair_is_hair_though_all_last_joints_have_an_end(named, leaf_bones):
    rows = [*tail(named, 3), ("wisp", "head", (0.1, 1.6, 0)), ("wisp_end", "wisp", (0.1, 1.5, 0))]
    if leaf_bones:
        rows += [(f"{s}_end", f"{s}_lower_arm", (0.6 if s == "left" else -0.6, 1.4, 0)) for s in ("left", "right")]
    who = character(rows)
    points = np.eye(3) * 0.1 + [0, 1.6, -0.1]
    hair = dict.fromkeys((f"{named}_1", f"{named}_2", "wisp"), points)
    body = skin(who, dict.fromkeys(("chest", "left_lower_arm", "right_lower_arm"), points))
    assert find_chains(who, [skin(who, hair), body]).names == (f"{named}_1", f"{named}_2", "wisp")


def test_a_holder_of_pieces_that_do_not_go_on_from_each_other_is_no_bone():
    """The next joint's children are not at its place: a group in a group."""
    who, skins = steered("hair", next_leaf=False)
    assert "phys_1" not in find_chains(who, [skin(who, skins)]).names


def test_controls_of_a_face_are_no_hair():
    who, skins = steered("lip")
    with pytest.raises(NeuralocksError, match="no hair chains"):
        find_chains(who, [skin(who, skins)])


def test_hair_in_compound_and_japanese_names():
    """Where the hair is part of the body's mesh, only names tell."""
    who = character([*tail("PigTailL", 2), *tail("左髪", 2, at=(0.1, 1.6, 0)), *tail("cable", 2, at=(-0.1, 1.6, 0))])
    points = np.eye(3) * 0.1 + [0, 1.6, -0.1]
    body = skin(who, {"hips": np.eye(3), "PigTailL_1": points, "左髪_1": points, "cable_1": points})
    assert find_chains(who, [body]).names == ("PigTailL_1", "左髪_1")


@pytest.mark.parametrize(
    "name", ["リボン", "左耳", "メガネ", "ribbon", "HairPin_L", "BunnyEar_L", "HeadBand", "brow_tail"]
)
def test_what_a_head_wears_is_no_hair(name):
    """In any language, although it has its own mesh and an end joint; hair below it is recognised by its name."""
    who = character([*tail(name, 2), *tail("後ろ毛", 2, parent=f"{name}_1"), *tail("x", 2, parent=f"{name}_1")])
    points = np.eye(3) * 0.1 + [0, 1.6, -0.1]
    meshes = [skin(who, {joint: points}) for joint in (f"{name}_1", "後ろ毛_1", "x_1")]
    assert find_chains(who, meshes).names == ("後ろ毛_1",)


@pytest.mark.parametrize("patterns", [None, ["hair_1"]])
def test_hair_may_hang_from_a_copy_of_the_head(patterns):
    """As on the rigs that Rigify makes, where a bone below other bones copies the control that is the head."""
    at = character().skeleton
    head = tuple(at.bind[[name.endswith("/head") for name in at.names].index(True), :3, 3])
    who = character([("copy", "hips", head), *tail("hair", 3, parent="copy")])
    points = np.eye(3) * 0.1 + [0, 1.6, -0.1]
    chains = find_chains(who, [skin(who, {"hair_1": points, "hair_2": points})], patterns)
    assert chains.names == ("hair_1", "hair_2") and list(chains.parents) == [-1, 0]
    elsewhere = character([("copy", "hips", np.add(head, 0.1)), *tail("hair", 3, parent="copy")])
    with pytest.raises(NeuralocksError, match="--head copy"):
        find_chains(elsewhere, [skin(elsewhere, {"hair_1": points, "hair_2": points})])


def test_a_branching_chain_is_one_chain():
    """Both branches are children of the forking joint, and its bones go to both."""
    fork = tail("hair_a", 3, at=(0.02, 1.5, -0.1), parent="hair_2") + tail(
        "hair_b", 2, at=(-0.02, 1.5, -0.1), parent="hair_2"
    )
    chains = find_chains(character([*tail("hair", 2), *fork]))
    assert len(chains.roots) == 1
    assert (chains.bone_joint == chains.names.index("hair_2")).sum() == 2


def test_joint_orients_and_facing_cancel():
    """The same rig with turned joints and a turned body has the same chains in canonical space."""
    plain = find_chains(character(tail("hair", 3)))
    who = character(tail("hair", 3), turn=from_vector(np.array([0.3, -1.0, 0.6])))
    turn = np.eye(4)
    turn[:3, :3] = from_vector(np.array([0, 2.1, 0]))
    moved = Character(Skeleton(who.skeleton.names, who.skeleton.parents, turn @ who.skeleton.bind))
    other = find_chains(moved)
    np.testing.assert_allclose(other.origins, plain.origins, atol=1e-9)
    np.testing.assert_allclose(other.bones, plain.bones, atol=1e-9)
