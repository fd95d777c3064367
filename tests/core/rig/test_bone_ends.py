# SPDX-License-Identifier: Apache-2.0
"""Where the bones of found chains end: at the next joint, a joint that marks the end, or the skin that the last joint moves."""

from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig import find_chains
from tests.core.rig.builders import character, skin, tail

ALONG, ASIDE = np.array([0, -0.06, -0.01]), np.array([0.06, 0, 0])


def test_an_end_joint_may_have_an_end_of_its_own():
    """FBX exporters add leaf bones to whatever is last: the bone still ends at the rig's own end joint."""
    who = character(tail("hair", 4))
    mesh = skin(who, {"hair_1": np.eye(3) * 0.1 + [0, 1.6, -0.1], "hair_2": np.eye(3) * 0.1 + [0, 1.5, -0.1]})
    chains = find_chains(who, [mesh])
    assert chains.names == ("hair_1", "hair_2")
    assert chains.chain_length(0) == pytest.approx(2 * np.hypot(0.06, 0.01))
    assert len(find_chains(who)) == 3  # without skin, nothing shows it


@pytest.mark.parametrize("aside", [(0, 0, 0), (0, 0, -0.3), (0.1, 0, 0)])
@pytest.mark.parametrize("what", ["socket", "pin"])
def test_sockets_and_pins_on_a_chain_are_none_of_its_bones(what, aside):
    """A joint without skin beside one with skin is no bone's end, and what is worn in hair rides on it."""
    at = np.add((0, 1.54, -0.11), aside)
    name = {"socket": "weapon_socket", "pin": "HairPin_L"}[what]
    who = character([*tail("hair", 4), (name, "hair_2", tuple(at)), (f"{name}_end", name, tuple(at + [0, 0, 0.05]))])
    skins = {f"hair_{i}": np.eye(3) * 0.02 + [0, 1.66 - 0.06 * i, -0.09 - 0.01 * i] for i in (1, 2, 3)}
    if what == "pin":
        skins[name] = np.eye(3) * 0.02 + at
    chains = find_chains(who, [skin(who, skins)])
    assert chains.names == ("hair_1", "hair_2", "hair_3")
    np.testing.assert_allclose(np.linalg.norm(chains.bones, axis=1), np.hypot(0.06, 0.01), rtol=1e-6)


def test_an_end_that_curls_back_is_still_the_end():
    rows = [*tail("hair", 2), ("hair_2_end", "hair_2", (0.02, 1.56, -0.14)), ("socket", "hair_2", (0.0, 1.5, -0.115))]
    who = character(rows)
    skins = {"hair_1": np.eye(3) * 0.05 + [0, 1.5, -0.1], "hair_2": np.eye(3) * 0.01 + [0.02, 1.56, -0.14]}
    np.testing.assert_allclose(find_chains(who, [skin(who, skins)]).bones[1], (0.02, 0.02, -0.03), atol=1e-9)


def test_a_strand_that_begins_at_a_joint_of_hair_is_refused_rather_than_left_still():
    rows = tail("hair", 4)
    at = rows[1][2]
    who = character([*rows, ("hair_b", "hair_2", at), ("hair_b_end", "hair_b", tuple(np.add(at, (0.05, -0.05, 0))))])
    skins = {name: np.eye(3) * 0.05 + [0, 1.5, -0.1] for name in ("hair_1", "hair_2", "hair_3", "hair_b")}
    with pytest.raises(NeuralocksError, match="no length"):
        find_chains(who, [skin(who, skins)])


@pytest.mark.parametrize("place", [(0.45, 1.54, -0.1), (0.3, 1.2, -0.1)], ids=["aside", "far down"])
def test_of_two_ends_the_one_ahead_is_the_bones(place):
    rows = [*tail("hair", 3), ("socket", "hair_2", place)]
    who = character(rows)
    skins = {name: np.eye(3) * 0.05 + [0, 1.5, -0.1] for name in ("hair_1", "hair_2")}
    np.testing.assert_allclose(
        np.linalg.norm(find_chains(who, [skin(who, skins)]).bones, axis=1), np.hypot(0.06, 0.01), rtol=1e-6
    )


@pytest.mark.parametrize("alone", [False, True])
def test_a_bone_without_length_is_told_with_the_joint_at_its_place(alone):
    """Beside a bone that has one, and where the chain goes on only there."""
    rows = tail("hair", 2 if alone else 4)
    who = character([*rows, ("hair_b", "hair_2", rows[1][2]), ("hair_c", "hair_b", tuple(np.add(rows[1][2], 0.05)))])
    points = np.eye(3) * 0.02
    names = ("hair_1", "hair_2", "hair_b", "hair_c") if alone else ("hair_1", "hair_2", "hair_3", "hair_b", "hair_c")
    with pytest.raises(NeuralocksError, match="'hair_2' has no length \\('hair_b' lies at the same place"):
        find_chains(who, [skin(who, dict.fromkeys(names, points))])


def test_a_last_joint_with_skin_moves():
    """Its bone reaches as far as the skin that it drives."""
    who = character(tail("hair", 2, step=(0, -0.06, 0)))
    mesh = skin(who, {"hair_1": [[0, 1.6, -0.1]] * 3, "hair_2": [[0, 1.54, -0.1], [0, 1.5, -0.1], [0, 1.44, -0.1]]})
    chains = find_chains(who, [mesh])
    assert chains.names == ("hair_1", "hair_2")
    np.testing.assert_allclose(chains.bones[1], [0, -0.10, 0], atol=1e-12)


@pytest.mark.parametrize(("beyond", "moves"), [(0.008, False), (0.03, True)])
def test_a_last_joint_that_its_skin_hardly_passes_is_the_end_of_the_bone_before(beyond, moves):
    who = character(tail("hair", 3))
    places = {name: who.skeleton.bind[list(who.skeleton.names).index(name), :3, 3] for name in who.skeleton.names}
    ends = {name.rsplit("/", 1)[-1]: place for name, place in places.items() if "hair" in name}
    along = np.array([0, -0.06, -0.01]) / np.hypot(0.06, 0.01)
    sheets = {name: [place + along * (0.05 if name != "hair_3" else beyond)] * 3 for name, place in ends.items()}
    assert find_chains(who, [skin(who, sheets)]).names == ("hair_1", "hair_2", "hair_3")[: 3 if moves else 2]


def test_skin_that_a_last_joint_hardly_moves_does_not_lengthen_its_bone():
    who = character(tail("hair", 2, step=(0, -0.06, 0)))
    mesh = skin(who, {"hair_1": [[0, 1.6, -0.1]] * 2 + [[0, 1.3, -0.1]], "hair_2": [[0, 1.44, -0.1]] * 3})
    share = np.where(np.arange(6) == 2, 0.1, 0.0)[:, None]
    mesh = replace(
        mesh,
        joint_indices=np.hstack([mesh.joint_indices, np.full((6, 1), mesh.joint_indices[-1, 0])]),
        joint_weights=np.hstack([mesh.joint_weights - share, share]),
    )
    np.testing.assert_allclose(find_chains(who, [mesh]).bones[1], [0, -0.10, 0], atol=1e-12)


@pytest.mark.parametrize("place", [(0.05, 1.54, -0.11), (0, 1.54, -0.11)], ids=["aside", "on its joint"])
def test_an_end_marker_off_the_hair_is_not_believed(place):
    """Exporters add "leaf bones" where a bone's axis points; the skin tells where the hair ends."""
    who = character([*tail("hair", 2), ("hair_2_end", "hair_2", place)])
    along, ends = np.array([0, -0.06, -0.01]), np.array([[0.2], [0.6], [1.2]])
    sheets = {f"hair_{i + 1}": [0, 1.6, -0.1] + along * (i + ends) for i in range(2)}
    chains = find_chains(who, [skin(who, sheets)])
    assert chains.names == ("hair_1", "hair_2")
    np.testing.assert_allclose(chains.bones, [along, 1.2 * along], atol=1e-12)


@pytest.mark.parametrize("down", [[0, 0, 0], [-0.06, -0.05, 0]], ids=["all of it", "some of it"])
def test_an_end_marker_of_hair_that_turns_is_believed(down):
    """The skin goes with it, or a part of the skin."""
    aside, tip = np.array([0.05, 0, 0]), np.array([0, 1.54, -0.11])
    who = character([*tail("hair", 2), ("hair_2_end", "hair_2", tuple(tip + aside))])
    along = np.array([[0.1], [0.1 if any(down) else 0.5], [0.9]])
    mesh = skin(who, {"hair_1": [[0, 1.57, -0.105]] * 3, "hair_2": tip + aside * along + np.outer(down, [0, 1, 0])})
    np.testing.assert_allclose(find_chains(who, [mesh]).bones[1], aside, atol=1e-12)


@pytest.mark.parametrize(
    ("end", "sheet", "believed"),
    [
        (ALONG, [0.6 * ASIDE, 0.9 * ASIDE, 0.3 * ALONG], True),
        (ASIDE, [0.3 * ASIDE, 0.4 * ASIDE, 0.3 * ALONG], True),
        (ASIDE, [0.4 * ASIDE, 0.6 * ALONG, 0.9 * ALONG], False),
        (ASIDE, [0.6 * ASIDE, 0.6 * ALONG, 0.9 * ALONG], True),
    ],
    ids=["ahead", "where the skin goes", "elsewhere", "elsewhere, with skin halfway there"],
)
def test_an_end_marker_is_believed_ahead_and_along_the_skin_and_on_it(end, sheet, believed):
    """Of a bone whose skin goes aside, goes less than half the way, or spreads."""
    who = character([*tail("hair", 2), ("hair_2_end", "hair_2", tuple(np.array([0, 1.54, -0.11]) + end))])
    skins = {"hair_1": [[0, 1.57, -0.105]] * 3, "hair_2": np.array([0, 1.54, -0.11]) + sheet}
    (bone,) = find_chains(who, [skin(who, skins)]).bones[1:]
    np.testing.assert_allclose(bone, end if believed else 0.9 * ALONG, atol=1e-9)


def test_the_bone_of_a_single_joint_points_where_its_skin_is_and_others_go_straight_on():
    sheet = np.array([0.02, 0.05, 0.1])[:, None] * [1, 0, 0.2]
    alone = character(tail("hair", 1))
    bones = find_chains(alone, [skin(alone, {"hair_1": [0, 1.6, -0.1] + sheet})]).bones
    np.testing.assert_allclose(bones, [sheet[-1]], atol=1e-12)
    last = character(tail("hair", 2))
    skins = {
        "hair_1": [[0, 1.57, -0.105]] * 3,
        "hair_2": [0, 1.54, -0.11] + np.array([[0.5], [1], [2]]) * ALONG + sheet,
    }
    along = ALONG / np.linalg.norm(ALONG)
    for patterns in (None, ["hair_1"], ["hair_*"]):
        bones = find_chains(last, [skin(last, skins)], patterns).bones
        np.testing.assert_allclose(bones[1], (2 * ALONG + sheet[-1]) @ along * along, atol=1e-12)
