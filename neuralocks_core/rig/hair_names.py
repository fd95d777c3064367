# SPDX-License-Identifier: Apache-2.0
"""Joint names that say hair, and those that say another part of the head."""

import re

from neuralocks_core.joint_names import leaf

_HAIR = (
    "hair|pony|braid|bang|fringe|tress|strand|lock|curl|pigtail|twintail|ahoge|kami|mane|plait|dread|bun|forelock"
    "|sideburn|tuft"
)
_FACE = (
    "eye|lid|brow|jaw|tongue|teeth|tooth|lip|mouth|cheek|nose|nostril|chin|face|facial|lash|ear|earring|temple|forehead|pupil|iris"
    "|oris|risorius|levator|special|orbicularis|squint|beard|glass|hat|crown|helmet|horn"
)
_HAIR_PARTS = ("hair", "pigtail", "twintail", "sidetail", "髪", "アホ毛", "おさげ", "ツインテ", "ポニテ", "もみあげ")
"""Hair wherever in a name they stand; the last ones are those of MikuMikuDance rigs, in files with UTF-8 names."""


def says_hair(name: str) -> bool:
    """Whether a joint's path or name says hair: `Hair_L.001`, `frontHair2` and `PigTail_L` do, `earring` does not."""
    whole = _own(name).lower().replace("_", "")
    return _begins(name, _HAIR) or any(part in whole for part in _HAIR_PARTS)


def says_face(name: str) -> bool:
    """Whether a joint's path or name says a part of the face, or what a head wears."""
    return _begins(name, _FACE)


def _begins(name: str, words: str) -> bool:
    parts = re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", _own(name))
    return any(re.match(f"(?:{words})", part.lower()) for part in parts)


def _own(name: str) -> str:
    return leaf(name).rsplit(":", 1)[-1]
