# SPDX-License-Identifier: Apache-2.0
"""Joint names that mean hair, and those that mean another part of the head or what it wears. Callers give a joint's own name, of
`Character.own_names`: a rig's name before it may be a word for either.
"""

import re

from neuralocks_core.anatomy.joint_names import leaf, without_namespace, words

_HAIR_ALONE = (
    "hair|pony|braid|pigtail|twintail|ahoge|mane|plait|dreadlock|forelock|sidelock|sideburn|topknot|cowlick|ringlet|mohawk|quiff"
    "|ponite"
)
_HAIR = f"{_HAIR_ALONE}|bang(?!le)|fringe|tress|strand|kami|dread|bun(?!ny)|wig(?!gle)"
_HAIR_OR_FACE = "lock(?!et)|curl"
"""Words that also fit features: lips and tongues curl."""
_FEATURES = "(?:left|right)?eye|lid|brow(?!n)|jaw|tongue|teeth|tooth|lip|mouth|nose|nostril|lash|oris|snout|muzzle|beak"
_OF_FACE = (
    f"{_FEATURES}|cheek|chin|face|facial|ear(?!ring)|temple|forehead"
    "|pupil|iris|risorius|levator|special|orbicularis|squint|fang"
)
_ANIMAL = "cat$|dog$|fox$|wolf$|bunny|rabbit|neko"
"""What has other ears."""
_FACE = (
    f"{_OF_FACE}|earring|beard|glass|hat|crown|helmet|horn|whisker|mo?ustache|bunny|neko"
    "|choker|sunglass|goggle|visor|monocle|spectacle|tiara|scarf|beret|turban"
    "|antenna|antler|necklace|locket|piercing|(?:cap|hood|veil|mask|halo|wing|mic)s?$"
)
_ORNAMENTS = "feather|flower|wreath|pendant|jewel|ornament|accessor|scrunch|barrette|(?:bow|pin|clip|bell|gem)s?$"
_HAIR_ANYWHERE = re.compile(
    "(?<!c)hair|pigtail|twintail|sidetail|(?:mae|ushiro|yoko)gami"
    "|髪|アホ毛|アホゲ|おさげ|ツインテ|ポニテ|もみあげ|テール|三つ編み|みつあみ|ちょんまげ|触角"
    r"|髮|刘海|马尾|辫|鬓|呆毛|[头前后侧长]发|发(?![^\W\da-z左右])|머리카락|앞머리|뒷머리|옆머리"
)
"""They count anywhere in a name, except 发, which also begins other words and counts only at a word's end; names in
MikuMikuDance rigs come in files with UTF-8 names."""
_OF_FACE_ANYWHERE = (
    "(?:elf|left|right)ears?[lr]?$|目|眼|瞳|眉|まつ毛|まつげ|睫|口|歯|牙|舌|あご|顎|(?<![猫犬狐狼兎獣])耳|鼻|頬|ほほ"
    "|下巴|눈|턱|혀|귀"
)
_FACE_ANYWHERE = re.compile(
    f"{_OF_FACE_ANYWHERE}|(?:cat|dog|fox|wolf)ears?[lr]?$|mimi(?!c)|headphone|headset|headband|headdress|headgear|headwear"
    "|耳|ひげ|髭|角"
    "|メガネ|めがね|帽|カチューシャ|ヘッド|ピアス|イヤリング|ティアラ|マスク|ゴーグル|かんざし|簪|冠|鈴|ミミ|みみ"
    "|蝴蝶结|안경|모자"
)
_WORN_IN_HAIR = re.compile(
    r"hair_?(?:pin|clip|band|tie|bow|acc(?:es?|essor(?:y|ies))?|ornament|deco(?:r|rations?)?|net|flower|feather|rope|ring)s?"
    r"(?![a-z]|_(?:curl|braid|lock))|ribbon"
    r"|リボン|리본|飾|饰|ヘア(?:ピン|バンド|ゴム)|髪(?:かざり|留|止|ゴム)|发(?:带|夹|卡|箍|簪|圈|绳)"
)
"""Ribbons and pins are stiff or have their own animation: they ride on the hair or the head."""
_SCALP = "facial"
"""First word of MetaHuman's face joints, of which `FACIAL_L_HairA1` moves a patch of scalp."""


def says_hair(name: str) -> bool:
    """Whether a joint's path or name means hair: `Hair_L.001`, `frontHair2` and `PigTail_L` do, `earring` and `hairpin` do not."""
    whole = _whole(name)
    if _no_hair(name):
        return False
    if _begins(name, _HAIR) or _HAIR_ANYWHERE.search(whole):
        return True
    if _begins(name, _HAIR_OR_FACE):
        return not _begins(name, _FEATURES)
    # Below a head these are hair, unless another word says otherwise: `brow_tail`, まつ毛.
    return not says_face(name) and (_begins(name, "tail|tuft") or "毛" in whole)


def says_hair_alone(name: str) -> bool:
    """Whether a joint's path or name means hair anywhere in a skeleton: below a chest, a fringe or a tail is a garment's."""
    whole = _whole(name)
    return not _no_hair(name) and bool(_begins(name, _HAIR_ALONE) or _HAIR_ANYWHERE.search(whole))


def says_face(name: str) -> bool:
    """Whether a joint's path or name means a part of the face, or what a head wears."""
    whole = _whole(name)
    return bool(_begins(name, f"{_FACE}|{_ORNAMENTS}") or _FACE_ANYWHERE.search(whole) or _worn_in_hair(name))


def says_feature(name: str) -> bool:
    """Whether a joint's path or name means a part of the face itself: no beard, no cat's ear, nor what is worn."""
    return bool(_begins(name, _OF_FACE) and not _begins(name, _ANIMAL) or re.search(_OF_FACE_ANYWHERE, _whole(name)))


def says_worn(name: str) -> bool:
    """Whether a joint's path or name means what is worn in hair."""
    return _worn_in_hair(name) or not says_hair(name) and bool(_begins(name, _ORNAMENTS))


def says_end(name: str) -> bool:
    """Whether a joint's path or name means the end of a bone."""
    return _begins(name, "end$|nub$|tip$|leaf$")


def says_twist(name: str) -> bool:
    """Whether a joint's path or name means that it turns about the bone that it lies on, with another joint."""
    return _begins(name, "twist|twst|roll$")


def _no_hair(name: str) -> bool:
    """Whether a name that has a word for hair means what is worn in it, or skin."""
    return _worn_in_hair(name) or words(_own(name))[:1] == [_SCALP]


def _worn_in_hair(name: str) -> bool:
    """A word alone counts: `hair_pin_L` is worn, `hair_pinned_L` is hair."""
    return any(_WORN_IN_HAIR.search(each) for each in (_whole(name), "_".join(words(_own(name)))))


def _begins(name: str, beginnings: str) -> bool:
    return any(re.match(f"(?:{beginnings})", word) for word in words(_own(name)))


def _whole(name: str) -> str:
    return _own(name).lower().replace("_", "")


def _own(name: str) -> str:
    return without_namespace(leaf(name))
