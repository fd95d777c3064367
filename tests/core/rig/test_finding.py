# SPDX-License-Identifier: Apache-2.0
"""Chains are found by themselves on rigs of any naming."""

from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.character import Character, Skeleton
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig import find_chains
from neuralocks_core.rig.hair_names import says_face, says_hair, says_hair_alone
from neuralocks_core.rig.measuring import placed_chains
from neuralocks_core.rotation import from_vector
from tests.core.rig.builders import character, skin, tail


def test_chains_by_name_with_end_joints():
    """The last joint of each chain drives nothing: it is a bone's end and does not move."""
    who = character([*tail("Hair_L", 3), *tail("Hair_R", 2), ("Eye_L", "head", (0.03, 1.6, 0.1))])
    chains = find_chains(who)
    assert chains.names == ("Hair_L_1", "Hair_L_2", "Hair_R_1")
    assert list(chains.parents) == [-1, 0, -1]
    assert chains.chain_length(0) == pytest.approx(2 * np.hypot(0.06, 0.01))


def test_strange_names_are_found_by_what_they_drive():
    """A subtree that drives only its own mesh is hair; the jaw and joints that drive the body's mesh are not."""
    who = character([*tail("J_opt_C_01", 2), *tail("jaw", 2, at=(0, 1.5, 0.1)), *tail("cable", 2, at=(0.1, 1.6, 0))])
    lock = skin(who, {"J_opt_C_01_1": np.eye(3) * 0.1 + [0, 1.6, -0.1]})
    body = skin(who, {"hips": np.eye(3), "head": np.eye(3) + 1, "cable_1": np.eye(3)})
    jaw = skin(who, {"jaw_1": np.eye(3)})
    assert find_chains(who, [lock, body, jaw]).names == ("J_opt_C_01_1",)


def test_an_end_joint_may_have_an_end_of_its_own():
    """FBX exporters add leaf bones to whatever is last: the bone still ends at the rig's own end joint."""
    who = character(tail("hair", 4))
    mesh = skin(who, {"hair_1": np.eye(3) * 0.1 + [0, 1.6, -0.1], "hair_2": np.eye(3) * 0.1 + [0, 1.5, -0.1]})
    chains = find_chains(who, [mesh])
    assert chains.names == ("hair_1", "hair_2")
    assert chains.chain_length(0) == pytest.approx(2 * np.hypot(0.06, 0.01))
    assert len(find_chains(who)) == 3  # without skin, nothing shows it


def test_what_names_of_many_conventions_say():
    """VRoid, Unity, Unreal, 3ds Max, MikuMikuDance, and artists' names for hair, faces and things worn."""
    hair = "J_Sec_Hair1_01 J_L_HairFront_00_SJ hair_01_l Bip001_HairA01 bangs_C_1 PonyTail_L SideLock_R maegami_01 tail_L_01 wig_01 "
    hair += "HairBun_L 前髪_01 左もみあげ 三つ編み1 横毛2 头发01"
    other = "leftEye eye_L brow_tail ear_tuft EarRing_L_02 CatEar_R nekomimi HairRibbon_L hair_clip_L HeadBand Sunglasses horn_L "
    other += "mustache_L bangle_1 BunnyEar_L wiggle_2 両目 まつ毛 舌1 髪飾り左 髪リボン1 メガネ 猫耳_L "
    other += "Mimi_L Kemonomimi_R ケモミミ_L うさみみ catear_L leftear Antler.L HairRope_L HairRing_L HairAcc_L HairFeather 髪ゴム "
    other += "FACIAL_C_Hair1 FACIAL_L_12IPV_Hair1 FACIAL_R_HairA3 FACIAL_L_Sideburn2"  # MetaHuman's scalp and temples
    assert [name for name in hair.split() if not says_hair(name)] == []
    assert [name for name in other.split() if says_hair(name)] == []
    assert [name for name in other.split() if not says_face(name)] == ["bangle_1", "wiggle_2"]


def test_hair_is_not_worn_because_its_name_begins_like_a_pin():
    hair = "hair_tied_l_1 hair_pinned_R hair_tier1_2 hair_feathered_l hair_clipped_1 hair_pin_curl_L hair_ringlet_2 hair_bowl"
    worn = "hair_pin_L hairpin_l_1 HairPinL hair_tie.001 HairClips_01 hair_band hairBow_R HAIRPIN hair_acc_2 HairAccessory_L"
    assert [name for name in hair.split() if not says_hair(name)] == []
    assert [name for name in worn.split() if says_hair(name) or not says_face(name)] == []


def test_features_may_curl_and_lock():
    """The bake would overwrite their animation; but there is hair beside ears and on foreheads."""
    features = "lip_curl_1 tongue_curl_L_2 brow_lock_1 eyeLock_R lash_curl_L"
    assert [name for name in features.split() if says_hair(name) or not says_face(name)] == []
    hair = "curl_1 lock_L_2 ear_lock_L forehead_curl pin_curl_1 brown_curl_1 eye_bangs_L"
    assert [name for name in hair.split() if not says_hair(name)] == []


def test_hair_in_chinese_and_in_the_words_of_animation():
    """发 at a word's end is hair; it also begins other words."""
    hair = "前发_左_1 后发1 侧发_R 鬓发 长发_1 卷发_左_1 发_02 アホゲ_1 触角_左 ちょんまげ 앞머리1 뒷머리"
    other = "发光 发射_1 发带 发夹_L 发簪 머리 머리끝"
    assert [name for name in hair.split() if not says_hair(name)] == []
    assert [name for name in other.split() if says_hair(name)] == []


def test_a_chair_is_no_hair():
    assert not any(map(says_hair, "wheelchair chair_01 Armchair prop_chair".split()))
    assert all(map(says_hair, "C_Hair CHair_1 bang_c_hair J_C_HAIR BackHair".split()))


def test_what_says_hair_wherever_it_hangs():
    """Coats have tails, fringes and strands; fingers curl, and rigs have locators."""
    assert all(map(says_hair_alone, "hair0_0 J_Sec_Hair1_01 PonyTail_L 左髪_1 braid_02 Mane_01".split()))
    other = "coat_tail_01 jacket_fringe_L strand_2 index_curl_L lock_01 bundle_3 HairPin_L scarf_01"
    assert [name for name in other.split() if says_hair_alone(name)] == []


@pytest.mark.parametrize("name", ["hair_group", "head_twist"])
def test_a_holder_that_drives_nothing_is_no_bone(name):
    """Whatever its name, and with one child or several: turning it would swing the hair's roots through the skull."""
    holder = (name, "head", (0, 1.6, -0.1))
    who = character([holder, *tail("hair", 3, parent=name)])
    meshes = [skin(who, {"hair_1": np.eye(3) * 0.1 + [0, 1.6, -0.1], "hair_2": np.eye(3) * 0.1 + [0, 1.5, -0.1]})]
    assert find_chains(who, meshes).names == ("hair_1", "hair_2")


def _steered(leaf, next_leaf=True):
    """A chain of three controls, each with a joint at its own place that drives its bone's skin, and that skin."""
    rows, skins = [], {}
    for i, (name, parent, place) in enumerate(tail("phys", 3)):
        rows += [(name, parent, place), (f"{leaf}_{i + 1}", name, place if i != 1 or next_leaf else (0, 1.5, -0.2))]
        skins[f"{leaf}_{i + 1}"] = [place, np.add(place, (0, -0.03, -0.005)), np.add(place, (0, -0.06, -0.01))]
    return character(rows), skins


@pytest.mark.parametrize("patterns", [None, ["phys_1"]])
def test_a_chain_of_controls_with_deforming_joints_beside_them_is_one_chain(patterns):
    """As separate chains, each would turn about its own pivot, and the skin would gape."""
    who, skins = _steered("hair")
    chains = find_chains(who, [skin(who, skins)], patterns)
    assert chains.names == ("phys_1", "phys_2", "phys_3") and list(chains.parents) == [-1, 0, 1]
    assert chains.chain_length(0) == pytest.approx(3 * np.hypot(0.06, 0.01))


@pytest.mark.parametrize("patterns", [None, ["off_1"], ["phys_1"]])
@pytest.mark.parametrize("leaf_bones", [False, True])
def test_a_chain_of_controls_goes_on_through_offsets_and_leaf_bones(patterns, leaf_bones):
    """Hand-made rigs have an offset above each control, and FBX exporters an end joint below each deforming one."""
    steered, skins = _steered("hair")
    at = {
        name.rpartition("/")[2]: tuple(bind[:3, 3]) for name, bind in zip(steered.skeleton.names, steered.skeleton.bind)
    }
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


@pytest.mark.parametrize("share", [0.25, 0.5])
def test_twist_joints_ride_on_the_bone_that_they_lie_on(share):
    """Turned by themselves, they would tear the skin off the next joint."""
    rows = tail("hair", 4)
    at = [np.array(place) for _, _, place in rows]
    twists = [(f"hair_{i + 1}_twist", f"hair_{i + 1}", tuple(at[i] + share * (at[i + 1] - at[i]))) for i in (0, 1)]
    beside = ("hair_side", "hair_2", tuple(at[1] + [0.001, -0.02, 0]))
    who = character([*rows, *twists, beside, ("hair_side_end", "hair_side", tuple(at[1] + [0.02, -0.06, 0]))])
    names = ("hair_1", "hair_2", "hair_3", "hair_1_twist", "hair_2_twist", "hair_side")
    skins = {name: np.eye(3) * 0.02 + [0, 1.5, -0.1] for name in names}
    assert find_chains(who, [skin(who, skins)]).names == ("hair_1", "hair_2", "hair_3", "hair_side")


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


def test_an_end_that_curls_back_is_still_the_end():
    rows = [*tail("hair", 2), ("hair_2_end", "hair_2", (0.02, 1.56, -0.14)), ("socket", "hair_2", (0.0, 1.5, -0.115))]
    who = character(rows)
    skins = {"hair_1": np.eye(3) * 0.05 + [0, 1.5, -0.1], "hair_2": np.eye(3) * 0.01 + [0.02, 1.56, -0.14]}
    np.testing.assert_allclose(find_chains(who, [skin(who, skins)]).bones[1], (0.02, 0.02, -0.03), atol=1e-9)


def test_a_pin_that_is_named_is_hair():
    pin = [("HairPin_L", "hair_1", (0.05, 1.5, -0.1)), ("HairPin_end", "HairPin_L", (0.05, 1.45, -0.1))]
    who = character([*tail("hair", 3), *pin])
    skins = {name: np.eye(3) * 0.05 + [0, 1.55, -0.1] for name in ("hair_1", "hair_2", "HairPin_L")}
    for patterns, own in ((None, False), (["hair_1"], False), (["hair_1", "HairPin*"], True)):
        assert ("HairPin_L" in find_chains(who, [skin(who, skins)], patterns).names) == own


def test_a_strand_that_begins_at_a_joint_of_hair_is_refused_rather_than_left_still():
    rows = tail("hair", 4)
    at = rows[1][2]
    who = character([*rows, ("hair_b", "hair_2", at), ("hair_b_end", "hair_b", tuple(np.add(at, (0.05, -0.05, 0))))])
    skins = {name: np.eye(3) * 0.05 + [0, 1.5, -0.1] for name in ("hair_1", "hair_2", "hair_3", "hair_b")}
    with pytest.raises(NeuralocksError, match="no length"):
        find_chains(who, [skin(who, skins)])


def test_of_two_ends_the_one_ahead_is_the_bones():
    rows = [*tail("hair", 3), ("socket", "hair_2", (0.45, 1.54, -0.1))]
    who = character(rows)
    skins = {name: np.eye(3) * 0.05 + [0, 1.5, -0.1] for name in ("hair_1", "hair_2")}
    np.testing.assert_allclose(
        np.linalg.norm(find_chains(who, [skin(who, skins)]).bones, axis=1), np.hypot(0.06, 0.01), rtol=1e-6
    )


def test_a_bone_without_length_is_told_with_the_joint_at_its_place():
    rows = tail("hair", 4)
    who = character([*rows, ("hair_b", "hair_2", rows[1][2]), ("hair_c", "hair_b", tuple(np.add(rows[1][2], 0.05)))])
    points = np.eye(3) * 0.02
    names = ("hair_1", "hair_2", "hair_3", "hair_b", "hair_c")
    with pytest.raises(NeuralocksError, match="'hair_2' has no length \\('hair_b' lies at the same place"):
        find_chains(who, [skin(who, dict.fromkeys(names, points))])


@pytest.mark.parametrize("leaf_bones", [False, True])
def test_end_joints_that_an_exporter_adds_make_no_hair_of_a_pipe(leaf_bones):
    """An end joint shows that a joint of a strange name is a bone, unless all last joints have one."""
    rows = [("pipe", "head", (0, 1.5, 0.1)), ("pipe_end", "pipe", (0, 1.5, 0.2))]
    if leaf_bones:
        rows += [(f"{s}_end", f"{s}_lower_arm", (0.6 if s == "left" else -0.6, 1.4, 0)) for s in ("left", "right")]
    who = character([*rows, *tail("hair", 2)])
    points = np.eye(3) * 0.1 + [0, 1.6, -0.1]
    arms = dict.fromkeys(("chest", "left_lower_arm", "right_lower_arm"), points)
    found = find_chains(who, [skin(who, {"pipe": points}), skin(who, {"hair_1": points}), skin(who, arms)]).names
    assert found == (("hair_1",) if leaf_bones else ("pipe", "hair_1"))


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
    who, skins = _steered("hair", next_leaf=False)
    assert "phys_1" not in find_chains(who, [skin(who, skins)]).names


def test_a_control_of_the_cap_of_the_hair_is_no_bone():
    """As if the joint drove the cap itself."""
    who, skins = _steered("hair")
    del skins["hair_1"]
    meshes = [skin(who, skins), _ring(who, "head"), _ring(who, "hair_1")]
    names = find_chains(who, meshes).names
    assert names[-2:] == ("phys_2", "phys_3") and "phys_1" not in names


def test_controls_of_a_face_are_no_hair():
    who, skins = _steered("lip")
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


def test_a_joint_that_drives_the_cap_of_the_hair_is_no_bone():
    """If it turned, it would take all hair through the forehead: only the tails below it move."""
    who = character([("Hair", "head", (0, 1.6, 0)), *tail("Hair", 3, parent="Hair")])
    tails = skin(who, {"Hair_1": np.eye(3) * 0.1 + [0, 1.6, -0.1], "Hair_2": np.eye(3) * 0.1 + [0, 1.5, -0.1]})
    head = _ring(who, "head")
    assert find_chains(who, [head, tails, _ring(who, "Hair", 1.1)]).names == ("Hair_1", "Hair_2")
    assert find_chains(who, [head, tails, _ring(who, "Hair", 0.2)]).names == ("Hair", "Hair_1", "Hair_2")
    beside = character([("Hair", "head", (0, 1.6, 0)), *tail("Hair", 3)])
    cap = _ring(beside, "Hair", 1.1)
    tails = skin(beside, {f"Hair_{i}": np.eye(3) * 0.1 + [0, 1.7 - 0.1 * i, -0.1] for i in (1, 2)})
    assert find_chains(beside, [_ring(beside, "head"), tails, cap]).names == ("Hair_1", "Hair_2")
    alone = character([("Hair", "head", (0, 1.6, 0))])
    with pytest.raises(NeuralocksError, match="'Hair' drives all hair on the skull.*--chains Hair"):
        find_chains(alone, [_ring(alone, "head"), _ring(alone, "Hair", 1.1)])


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


def test_a_cap_may_leave_the_forehead_free_and_ears_stand_out():
    """Both are narrower than the head's box; a bun as large as that, behind the head, is a hair bone."""
    who = character([("Hair", "head", (0, 1.6, 0)), *tail("Hair", 3, parent="Hair")])
    tails = skin(who, {"Hair_1": np.eye(3) * 0.1 + [0, 1.6, -0.1], "Hair_2": np.eye(3) * 0.1 + [0, 1.5, -0.1]})
    head, cap = _ring(who, "head"), _ring(who, "Hair")
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


def _ring(who, joint, size=1.0):
    """Skin around the head, which a joint drives."""
    points = np.stack([np.cos(np.arange(12)), np.full(12, 1.65), np.sin(np.arange(12))], axis=-1)
    mesh = skin(who, {joint: points[:3]})
    indices = np.full((12, 1), mesh.joint_indices[0, 0])
    points = points * [0.1 * size, 1, 0.1 * size]
    return replace(mesh, points=points, joint_indices=indices, joint_weights=np.ones((12, 1)), triangles=[])


def test_a_branching_chain_is_one_chain():
    """Both branches are children of the forking joint, and its bones go to both."""
    fork = tail("hair_a", 3, at=(0.02, 1.5, -0.1), parent="hair_2") + tail(
        "hair_b", 2, at=(-0.02, 1.5, -0.1), parent="hair_2"
    )
    chains = find_chains(character([*tail("hair", 2), *fork]))
    assert len(chains.roots) == 1
    assert (chains.bone_joint == chains.names.index("hair_2")).sum() == 2


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
