# SPDX-License-Identifier: Apache-2.0
"""Arms and legs of rigs whose names do not identify them: the pairs of chains that leave the trunk as mirror images."""

from dataclasses import dataclass

import numpy as np

ALIKE = 0.15
"""Two chains are mirror images if their ends are symmetric about the trunk to within this share of their distance."""
LONG = 0.3
"""A limb is at least this long, as a share of the distance from the head down to the lowest joint."""
UPRIGHT = 0.7
"""Legs run along the trunk if this share of them does. An animal's do not, and it has no arms."""
LEVEL = 0.5
"""A leg's last bone is a foot, and points where the character looks, if at least this share of it is level."""
ASIDE = 0.1
"""A finger begins at least this share of the middle one's first bone aside of it; twist joints lie on their bone."""
COLLAR = 0.13
"""An arm's first joint is the collar bone's if it is nearer to the middle than this share of the arm's reach."""


@dataclass(frozen=True)
class _Pair:
    """Two mirrored chains: joints from the trunk to the farthest tip."""

    rank: int  # of the trunk joint that they leave, counted from the head
    chains: tuple[list[int], list[int]]
    span: np.ndarray  # from the second one's end to the first one's
    low: float  # height of the ends


def limbs_by_shape(way: list[int], parents, positions, sides) -> dict[str, dict[str, int]]:
    """Joints of both arms and both legs: 'arm' and 'leg' -> semantic name -> joint. A pair that is missing, or whose sides cannot
    be told apart, is left out.

    Legs are the pair of chains that ends lowest, arms the widest of the pairs that leave the trunk nearer to the head. Left and
    right come from the sides in names if there are any, else from where the toes point; else the character is assumed to face
    +Z if it stands along Y, and -Y if it stands along Z, as exporters write it.

    Args:
        way: the head and its ancestors, to the root.
        parents: (J,) parent indices, -1 for roots.
        positions: bind positions (J, 3), in any unit and up axis.
        sides: 'left', 'right' or '' of each joint, from its name.
    """
    parents, at = np.asarray(parents, int), np.asarray(positions, float)
    rise = at[way[0]] - at[way[-1]]
    height = np.linalg.norm(rise)
    if not np.isfinite(at).all() or height == 0:
        return {}
    up = rise / height
    pairs = _pairs(way, parents, at, up)
    legs = min((p for p in pairs if p.low < (at[way[-1]] + at[way[0]]) @ up / 2), key=lambda p: p.low, default=None)
    if legs is not None and not _upright(legs, at, up):
        return {}
    upper = [p for p in pairs if p is not legs and (legs is None or p.rank <= legs.rank)]
    arms = max(upper, key=lambda p: np.linalg.norm(p.span), default=None)
    found: dict[str, dict[str, int]] = {}
    for limb, pair, parts in (
        ("arm", arms, ("shoulder", "upper_arm", "lower_arm", "hand")),
        ("leg", legs, ("", "upper_leg", "lower_leg", "foot")),
    ):
        if pair is None or (first := _first_side(pair, legs, at, up, sides)) is None:
            continue
        second = "right" if first == "left" else "left"
        found[limb] = {
            f"{side}_{part}": joint
            for side, chain in zip((first, second), pair.chains, strict=True)
            for part, joint in _named(chain, parents, at, pair.span / 2, parts).items()
        }
    return found


def _pairs(way: list[int], parents, at: np.ndarray, up: np.ndarray) -> list[_Pair]:
    """All pairs of long, mirrored chains of three joints or more along the trunk."""
    children: list[list[int]] = [[] for _ in parents]
    for joint, parent in enumerate(parents):
        if parent >= 0:
            children[parent].append(joint)
    least = LONG * (at[way[0]] @ up - (at @ up).min())
    pairs = []
    for rank, trunk in enumerate(way[1:]):
        chains = [_to_the_tip(child, children, parents, at) for child in children[trunk] if child not in way]
        chains = [c for c in chains if len(c) >= 3 and np.linalg.norm(np.diff(at[c], axis=0), axis=1).sum() >= least]
        for i, one in enumerate(chains):
            for other in chains[i + 1 :]:
                span = at[one[-1]] - at[other[-1]]
                wide = np.linalg.norm(span)
                middle = (at[one[-1]] + at[other[-1]]) / 2 - at[trunk]
                even = max(abs(middle @ span) / max(wide, 1e-12), abs(span @ up)) <= ALIKE * wide
                if even and wide > 0:
                    low = min(at[one[-1]] @ up, at[other[-1]] @ up)
                    pairs.append(_Pair(rank, (one, other), span, low))
    return pairs


def _upright(legs: _Pair, at: np.ndarray, up: np.ndarray) -> bool:
    """Whether the legs go along the trunk."""
    way = np.mean([at[chain[0]] - at[chain[-1]] for chain in legs.chains], axis=0)
    return way @ up > UPRIGHT * np.linalg.norm(way)


def _to_the_tip(joint: int, children, parents: np.ndarray, at: np.ndarray) -> list[int]:
    """The path from this joint to the joint below it that is farthest from it."""
    below, stack = [], [joint]
    while stack:
        below.append(stack.pop())
        stack += children[below[-1]]
    way = [below[int(np.argmax(np.linalg.norm(at[below] - at[joint], axis=1)))]]
    while way[-1] != joint:
        way.append(int(parents[way[-1]]))
    return way[::-1]


def _first_side(pair: _Pair, legs: _Pair | None, at: np.ndarray, up: np.ndarray, sides) -> str | None:
    """Side of the pair's first chain; None if nothing tells it."""
    told = [{sides[joint] for joint in chain} - {""} for chain in pair.chains]
    if len(told[0] ^ told[1]) == 2 and all(len(one) == 1 for one in told):
        return told[0].pop()
    ahead = np.cross(pair.span, up)
    ahead /= np.linalg.norm(ahead)  # where the character looks if the first chain is the left one
    if legs is not None:
        foot = np.mean([at[chain[-1]] - at[chain[-2]] for chain in legs.chains], axis=0)
        if abs(foot @ ahead) > LEVEL * np.linalg.norm(foot):
            return "left" if foot @ ahead > 0 else "right"
    usual = np.array([0, 0, 1.0]) if abs(up[1]) >= abs(up[2]) else np.array([0, -1.0, 0])
    if abs(usual @ ahead) < np.sqrt(0.5):
        return None
    return "left" if usual @ ahead > 0 else "right"


def _named(chain: list[int], parents, at: np.ndarray, reach: np.ndarray, parts) -> dict[str, int]:
    """Joints by part: the limb's two long bones are the pair whose shorter bone is longest; a joint with fingers is its end."""
    collar, upper, lower, end = parts
    fingers = next((i for i in range(2, len(chain) - 1) if _spreads(*chain[i : i + 2], parents, at)), len(chain) - 1)
    bones = np.linalg.norm(np.diff(at[chain[: fingers + 1]], axis=0), axis=1)
    trunk = at[chain[0]] - at[parents[chain[0]]]
    first = int(bool(collar) and fingers >= 3 and abs(trunk @ reach) < COLLAR * (reach @ reach))
    start = first + int(np.argmax(np.minimum(bones[first:-1], bones[first + 1 :])))
    joints = {upper: chain[start], lower: chain[start + 1], end: chain[start + 2]}
    if collar and start:
        joints[collar] = chain[start - 1]
    return joints


def _spreads(joint: int, following: int, parents, at: np.ndarray) -> bool:
    """Whether a joint has at least two children beside the way to the following one, as a hand has fingers."""
    way, others = at[following] - at[joint], at[parents == joint] - at[joint]
    length = np.linalg.norm(way)
    return length > 0 and int((np.linalg.norm(np.cross(others, way), axis=1) > ASIDE * length**2).sum()) >= 2
