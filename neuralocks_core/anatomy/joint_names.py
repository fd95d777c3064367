# SPDX-License-Identifier: Apache-2.0
"""What joint names say: which side a joint is on, which part it is once namespaces and rig prefixes are removed, and which
joint a user means.
"""

import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from difflib import get_close_matches
from os.path import commonprefix

from neuralocks_core.errors import NeuralocksError

_SIDES = {"left": "left", "l": "left", "right": "right", "r": "right"}
_NOISE = {
    "bip",
    "bip01",
    "bip001",
    "j",
    "c",
    "def",
    "org",
    "mixamorig",
    "cc",
    "base",
    "bone",
    "jnt",
    "joint",
    "skin",
    "b",
    "sk",
    "valvebiped",
    "bend",
    "stretch",
    "armature",
    "x",
    "bnd",
    "bind",
    "skn",
    "env",
    "rig",
    "drv",
    "deform",
    "jt",
    "bj",
}
_JAPANESE = {
    "左": "Left",
    "右": "Right",
    "頭": "Head",
    "手首": "Wrist",
    "足首": "Ankle",
    "首": "Neck",
    "肩": "Clavicle",
    "腕": "UpperArm",
    "ひじ": "Elbow",
    "足": "UpLeg",
    "ひざ": "Knee",
    "両目": "Eyes",
    "目": "Eye",
}
"""MikuMikuDance's standard bones, in files with UTF-8 names; a word that contains another comes before it."""
_TRUNK = {"head", "neck", "spine"}
"""With the parts of limbs, words that say what a joint is, even if many joints begin with them."""
_HAIR = "hair"
"""Likewise, unless the trunk begins with it."""
_WORD = "[A-Z]?[a-z]+|[LR](?=[UF]Arm)|[A-Z]+(?![a-z])"
_PREFIX_ENDS = ":|_.-"
SHARED = 0.9
"""Share of the joints that begin with a namespace; exporters add a root of their own above."""


def leaf(path: str) -> str:
    """A joint's own name: the last part of its path."""
    return path.rsplit("/", 1)[-1]


def carrier(head: str, *paths: str) -> str:
    """Own name of the joint above both the head and some other joints, all given by their paths; if they share none, the root
    above the first of the others. The head itself is never its own carrier.
    """
    others = [path.strip("/").split("/") for path in paths]
    shared = commonprefix([head.strip("/").split("/"), *(names[:-1] for names in others)])
    return shared[-1] if shared else others[0][0]


def without_namespace(name: str) -> str:
    """A joint's own name without the part before a colon."""
    return name.rsplit(":", 1)[-1]


def own_names(names: Sequence[str], head: int | None) -> list[str]:
    """Names of joints without their parents' and without the rig's, which may be a word for hair or face: of `Hatsune:Jaw` and
    `Hatsune_Jaw`, since USD writes a colon as an underscore, `Jaw`.

    The head has the rig's name, too, and with it the neck or the spine, or nearly all joints that are not below the head. What only
    its own joints begin with, `pony` or `FACIAL`, says what they are.

    Args:
        names: joint paths (J), separated by `/`.
        head: index of the head's joint; if it is None, only what stands before a colon is the rig's name.
    """
    own = [without_namespace(leaf(name)) for name in names]
    if head is None:
        return own
    beside = [j for j, name in enumerate(names) if not name.startswith(f"{names[head]}/")]
    while True:
        first, *rest = _own_words(own[head]) or [""]
        meant = first in _SIDES or first in _TRUNK
        if not rest or meant or not _is_of_rig(first, [own[j] for j in beside], own[head]):
            return own
        shorter = [_without_first(name) if _own_words(name)[:1] == [first] else name for name in own]
        if shorter[head] == own[head]:  # letters stand before the word that are in none
            return own
        own = shorter


def _is_of_rig(first: str, beside: list[str], head: str) -> bool:
    """Whether the neck or the spine begins with this word, or nearly all of the joints that are not below the head, the head
    among them.
    """
    within = [name for name in beside if _own_words(name)[:1] == [first]]
    trunk = any({"neck", "spine"} & set(_own_words(name)) for name in within if name != head)
    return trunk or len(within) >= max(SHARED * len(beside), 4)


def _without_first(name: str) -> str:
    """A name from its second word on; as it is if it begins with letters that are in no word."""
    return re.sub(rf"^[\W\d_]*(?:{_WORD})[\W\d_]*", "", name)


def words(name: str) -> list[str]:
    """Words of a name in lower case, without numbers; Motive's `LUArm` and `LFArm` have one letter for the side."""
    return [word.lower() for word in re.findall(_WORD, name)]


def sides_and_keys(names: list[str], parts: set[str]) -> list[tuple[str, str]]:
    """('left' | 'right' | '', words in one, in lower case, without numbers, sides and prefixes) of each joint.

    Args:
        names: the joints' own names, without their parents'.
        parts: words that mean a part of the body.
    """
    return [_side_and_key(words) for words in _without_namespace([_own_words(name) for name in names], parts)]


def _own_words(name: str) -> list[str]:
    """Words of a joint's own name, with MikuMikuDance's in English; its full-width `ＩＫ` and `Ｄ` count as letters."""
    name = without_namespace(unicodedata.normalize("NFKC", name))
    if not name.isascii():
        for word, part in _JAPANESE.items():
            name = name.replace(word, part)
    return words(name)


def _without_namespace(names: list[list[str]], meant: set[str]) -> list[list[str]]:
    """The words of each joint without its namespace, whose colon is an underscore in USD (`Character1_LeftArm`)."""
    own = meant | _TRUNK | _SIDES.keys()
    while True:
        firsts = Counter(words[0] for words in names if words)
        found = [first for first in firsts if first not in own and _is_namespace(first, names)]
        if not found:
            return names
        names = [words[1:] if words[:1] == found[:1] else words for words in names]


def _is_namespace(first: str, names: list[list[str]]) -> bool:
    """Whether nearly all joints begin with this word, or the trunk does: the only head, and a neck or spine with it."""
    within = [words for words in names if words[:1] == [first]]
    if len(within) < 4:
        return False
    heads = [words for words in names if words[-1:] == ["head"]]
    trunk = len(heads) == 1 and heads[0] in within and any({"neck", "spine"} & set(words) for words in within)
    return trunk or first != _HAIR and len(within) >= SHARED * len(names)


def _side_and_key(words: list[str]) -> tuple[str, str]:
    """('left' | 'right' | '', part name without side and rig prefix)."""
    if len(words) == 1 and words[0][:4] == "left" and len(words[0]) > 4:
        words = ["left", words[0][4:]]
    elif len(words) == 1 and words[0][:5] == "right" and len(words[0]) > 5:
        words = ["right", words[0][5:]]
    side = next((_SIDES[word] for word in words if word in _SIDES), "")
    words = [word for word in words if word not in _SIDES and word not in _NOISE]
    # mGear writes the component, then its joint, `shoulder_L0_shoulder_jnt`.
    return side, "".join(word for i, word in enumerate(words) if words[i - 1 : i] != [word])


def prefixed_otherwise(names: Sequence[str], there: set[str]) -> tuple[str, ...] | None:
    """The same names with another prefix: 'Hair1' may be 'rig:Hair1', and 'A_Hair1' may be 'B_Hair1'.

    A prefix ends at one of `:|_.-`, or is empty.

    Returns:
        One name for each, if there is exactly one way, else None; None also if all are in `there` as they are.
    """
    if there.issuperset(names):
        return None
    shared = commonprefix(list(names))
    ways = set()
    for start in (0, *(k for k in range(1, len(shared) + 1) if shared[k - 1] in _PREFIX_ENDS)):
        rests = [name[start:] for name in names]
        for other in there:
            prefix = other.removesuffix(rests[0])
            if all(rests) and prefix != other and (not prefix or prefix[-1] in _PREFIX_ENDS):
                ways.add(tuple(prefix + rest for rest in rests))
    ways = [way for way in ways if there.issuperset(way)]
    return ways[0] if len(ways) == 1 else None


def find_joint(names, wanted: str) -> int:
    """Index of the joint with this path or this unique last part.

    Raises:
        NeuralocksError: there is none, or several.
    """
    hits = [i for i, name in enumerate(names) if name == wanted] or [
        i for i, name in enumerate(names) if leaf(name) == wanted
    ]
    if len(hits) != 1:
        fact = (
            "several joints have that name; give its full path"
            if hits
            else f"no such joint{_alike(names, wanted)}; neuralocks inspect lists all"
        )
        raise NeuralocksError(f"joint '{wanted}': {fact}")
    return hits[0]


def _alike(names, wanted: str) -> str:
    """The joints that a misspelt name may stand for, as a question."""
    spelt = {leaf(name).lower(): leaf(name) for name in names}
    near = get_close_matches(leaf(wanted).lower(), spelt)
    return f", perhaps {' or '.join(repr(spelt[each]) for each in near)}" if near else ""
