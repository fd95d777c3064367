# SPDX-License-Identifier: Apache-2.0
"""What names say of joints: hair, faces and what is worn, in many conventions and languages."""

from neuralocks_core.rig.hair_names import (
    says_end,
    says_face,
    says_feature,
    says_hair,
    says_hair_alone,
    says_twist,
    says_worn,
)


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


def test_what_belongs_to_the_face_itself():
    """Neither what grows on it nor what it wears, nor the ears of a costume."""
    features = "leftEye jaw_1 lip_curl_1 ear_L elfEar_L LeftEar temple_R 左目 まつ毛 右耳 혀"
    others = "beard_1 whisker_L CatEar_R cat_ear_L Fox_Ear_1 猫耳_L nekomimi hat_1 earring_L hair_pin_L Hair_01 neck"
    assert [name for name in features.split() if not says_feature(name)] == []
    assert [name for name in others.split() if says_feature(name)] == []


def test_what_is_worn_in_hair():
    worn = "hair_pin_L HairRibbon_1 髪飾り左 feather_L bow_1 scrunchie"
    others = "bowl_1 hair_feathered_l crown_1 Hair_01 eye_L"
    assert [name for name in worn.split() if not says_worn(name)] == []
    assert [name for name in others.split() if says_worn(name)] == []


def test_ends_and_twists_are_told_by_whole_words():
    assert all(map(says_end, "hair_03_end HairNub Bip001_Ponytail1Nub tail_tip leaf_1".split()))
    assert not any(map(says_end, "endless_1 tipped_hair_2 leafy_L nubs_1 hair_03".split()))
    assert all(map(says_twist, "upperarm_twist_01_l LeftForeArmTwist arm_twst lowerarm_roll".split()))
    assert not any(map(says_twist, "roller_1 hair_rolled_2 neck".split()))
