# SPDX-License-Identifier: Apache-2.0
"""The hair joints of a rig: a forest of bones below the head.

A *chain* is one tree of the forest; it may branch. Everything is kept in canonical space (origin at the head
joint, Y up, +Z face, metres), where joint orients, units and up axes of the rig are gone.
"""

from dataclasses import dataclass, replace

import numpy as np

from neuralocks_core.anatomy.joint_names import carrier, leaf, prefixed_otherwise
from neuralocks_core.errors import NeuralocksError

SAME_AXES = 1e-5
"""Axes that differ by less are the same: one rig, read by two programs."""
SIZES = (0.7, 1.4)
"""How many times as large a character may be as the one that a model was trained for: turns do not depend on size, but how
fast gravity swings hair does, by its square root."""


@dataclass(frozen=True, eq=False)
class HairChains:
    """Moving hair joints in bind pose, parents before children.

    Attributes:
        names: last path parts of the joints, (N).
        joints: their indices in the skeleton, (N,).
        parents: index of the moving joint that carries each one, -1 if the head does, (N,).
        chain: the chain that each belongs to, (N,).
        origins: the pivot of each one, canonical, (N, 3) [m].
        axes: bind axes of each one as columns, canonical, (N, 3, 3).
        bone_joint: which joint moves each bone, (M,); a branching joint moves several.
        bone_end: moving joint at a bone's far end, -1 for a free end, (M,).
        bones: from a bone's joint to its far end, canonical, (M, 3) [m].
    """

    names: tuple[str, ...]
    joints: np.ndarray
    parents: np.ndarray
    chain: np.ndarray
    origins: np.ndarray
    axes: np.ndarray
    bone_joint: np.ndarray
    bone_end: np.ndarray
    bones: np.ndarray

    def __post_init__(self):
        object.__setattr__(self, "names", tuple(self.names))
        for name in ("joints", "parents", "chain", "bone_joint", "bone_end"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), np.int32))
        for name in ("origins", "axes", "bones"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), float))
        count, bones = len(self.names), len(self.bone_joint)
        shapes = {
            "joints": (count,),
            "parents": (count,),
            "chain": (count,),
            "origins": (count, 3),
            "axes": (count, 3, 3),
        }
        shapes |= {"bone_end": (bones,), "bones": (bones, 3)}
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise NeuralocksError(
                    f"hair chains: {name} is {getattr(self, name).shape}, not {shape}; get an undamaged model"
                )
        if not count:
            raise NeuralocksError("hair chains: none given; a rig needs at least one hair joint that moves")
        if (self.parents >= np.arange(count)).any() or self.parents.min() < -1:
            raise NeuralocksError("hair chains: a joint comes before its parent; get an undamaged model")
        if bones < 1 or not 0 <= self.bone_joint.min() <= self.bone_joint.max() < count or self.bone_end.max() >= count:
            raise NeuralocksError("hair chains: a bone names a joint that is not there; get an undamaged model")
        led = self.parents >= 0
        known = (self.chain >= 0) & (self.chain < count - led.sum())
        if not known.all() or (self.chain[led] != self.chain[self.parents[led]]).any():
            raise NeuralocksError("hair chains: a joint is in another chain than its parent; get an undamaged model")
        if not all(np.isfinite(getattr(self, name)).all() for name in ("origins", "axes", "bones")):
            raise NeuralocksError("hair chains: NaN or infinity in the bind pose; repair the skeleton")
        axes = self.axes.clip(-2, 2)  # the product of larger ones may overflow
        if np.abs(axes @ axes.swapaxes(1, 2) - np.eye(3)).max() > 1e-3 or np.linalg.det(axes).min() < 0:
            raise NeuralocksError("hair chains: bind axes are not those of a rotation; get an undamaged model")

    def __len__(self) -> int:
        return len(self.names)

    @property
    def lengths(self) -> np.ndarray:
        """Length of every bone (M,) [m]."""
        return np.linalg.norm(self.bones, axis=1)

    @property
    def ways(self) -> np.ndarray:
        """Vectors from each joint's carrier, the head's origin for first joints, to the joint, (N, 3) [m]."""
        return self.origins - np.where((self.parents >= 0)[:, None], self.origins[self.parents], 0)

    @property
    def roots(self) -> np.ndarray:
        """First joint of every chain, (chains,)."""
        return np.flatnonzero(self.parents < 0)

    @property
    def tops(self) -> list[str]:
        """Names of the chains' first joints."""
        return [self.names[root] for root in self.roots]

    def chain_name(self, chain: int) -> str:
        """A chain has the name of its first joint."""
        return self.names[self.roots[chain]]

    def chain_length(self, chain: int) -> float:
        """Longest path along the bones of a chain [m]."""
        reach = np.zeros(len(self))
        for bone in np.argsort(-self.bone_joint, kind="stable"):
            end = reach[self.bone_end[bone]] if self.bone_end[bone] >= 0 else 0.0
            joint = self.bone_joint[bone]
            reach[joint] = max(reach[joint], self.lengths[bone] + end)
        return float(reach[self.roots[chain]])

    def named_as(self, names, below: np.ndarray) -> "HairChains":
        """These chains with their names in another copy of the rig that has another common prefix: a namespace, or an exporter's.
        Returned unchanged if the names are there, or if the prefix is ambiguous.

        Args:
            names, below: as for `match`.
        """
        there = {leaf(names[index]) for index in np.flatnonzero(below)}
        renamed = prefixed_otherwise(self.names, there)
        return replace(self, names=renamed) if renamed else self

    def match(self, names, below: np.ndarray) -> np.ndarray:
        """Indices (N,) of these joints among `names`, joint paths, of which only those below the head count (`below` (J,)):
        joints of a tail or a coat may have the same names.

        Raises:
            NeuralocksError: one is missing or ambiguous, that is, the model was trained for other chains.
        """
        places: dict[str, list[int]] = {}
        for index in np.flatnonzero(below):
            places.setdefault(leaf(names[index]), []).append(int(index))
        missing = [name for name in self.names if name not in places]
        hung = [path for path in names if leaf(path) in missing]
        if missing and {leaf(path) for path in hung}.issuperset(missing):
            above = carrier(names[int(np.argmax(below))], *hung)
            raise NeuralocksError(
                f"model: joint '{leaf(hung[0])}' does not hang below this head, but from '{above}': name that with --head {above}, "
                "as in training, or train a model for this rig (neuralocks rig train)"
            )
        if missing:
            raise NeuralocksError(
                f"model: below this head there is no joint '{missing[0]}', which it moves ({len(missing)} of {len(self)} are missing); "
                "train a model for this rig (neuralocks rig train)"
            )
        joints: list[int] = []
        for name, parent in zip(self.names, self.parents):
            found = places[name]
            if len(found) > 1 and parent >= 0:  # the tip of a lock and that of a tongue, say
                found = [joint for joint in found if names[joint] == f"{names[joints[parent]]}/{name}"]
            if len(found) != 1:
                raise NeuralocksError(f"model: several joints below the head are named '{name}'; rename all but one")
            joints += found
        return np.array(joints, int)

    def check_same(self, other: "HairChains") -> float:
        """Refuse a model that was trained for chains of another shape: bones that differ by more than 2 %, apart from overall
        size, or another hierarchy.

        Returns:
            how many times as large the other chains are: 1 if the size is the same within 2 %, else within `SIZES`.

        Raises:
            NeuralocksError: the message names the joint, or the ratio of the sizes.
        """
        order = {name: index for index, name in enumerate(other.names)}
        for index, name in enumerate(self.names):
            if name not in order:
                raise NeuralocksError(
                    f"model: it moves joint '{name}', which is not a hair joint here; train a model for this rig"
                )
            there, parent = order[name], self.parents[index]
            parent_there = other.parents[there]
            if (self.names[parent] if parent >= 0 else "") != (other.names[parent_there] if parent_there >= 0 else ""):
                raise NeuralocksError(
                    f"model: joint '{name}' hangs from another joint here; train a model for this rig"
                )
        ways, ways_there = self.ways, other.ways[[order[name] for name in self.names]]
        lengths = np.linalg.norm(ways, axis=1)
        told = lengths > 1e-3  # a joint may coincide with its carrier
        ratio = float(np.median(np.linalg.norm(ways_there, axis=1)[told] / lengths[told])) if told.any() else 1.0
        for size in (1.0, ratio):
            off = np.linalg.norm(size * ways - ways_there, axis=1)
            wrong = np.flatnonzero(off > size * (0.02 * lengths + 1e-4))
            if not len(wrong):
                break
        if len(wrong):
            raise NeuralocksError(
                f"model: joint '{self.names[wrong[0]]}' lies {1e3 * off[wrong[0]]:.1f} mm away from its place in the rig "
                "that the model was trained for; train a model for this rig"
            )
        if not SIZES[0] <= size <= SIZES[1]:
            raise NeuralocksError(
                f"model: the character is {size:.3g} times as large as the one that the model was trained for; check "
                "metersPerUnit and the character's scale, or train a model for this rig"
            )
        return size

    def turns_on(self, other: "HairChains", turns: np.ndarray) -> np.ndarray:
        """Turns of these joints in the bind axes that they have in `other`, a rig that `check_same` accepted: after another
        exporter, the same rotation in space has other numbers.

        Args:
            turns: (..., N, 4) wxyz in these chains' own bind axes.

        Returns:
            (..., N, 4) wxyz, bit for bit the same if the axes are the same.
        """
        order = {name: index for index, name in enumerate(other.names)}
        there = other.axes[[order[name] for name in self.names]]
        between = np.swapaxes(there, 1, 2) @ self.axes
        changed = np.abs(between - np.eye(3)).max(axis=(1, 2)) > SAME_AXES
        result = np.array(turns)
        result[..., changed, 1:] = np.einsum("nij,...nj->...ni", between[changed], result[..., changed, 1:])
        return result

    def to_json(self) -> dict:
        """Plain values for the model file."""
        return {name: np.asarray(getattr(self, name)).tolist() for name in self.__dataclass_fields__}

    @classmethod
    def from_json(cls, values: dict) -> "HairChains":
        """Build it from the output of `to_json`.

        Raises:
            NeuralocksError: the values are not those of hair chains.
        """
        try:
            if len(values["names"]) > 10000 or not all(isinstance(n, str) for n in values["names"]):
                raise ValueError("names")
            return cls(**{name: values[name] for name in cls.__dataclass_fields__})
        except NeuralocksError:
            raise
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise NeuralocksError(f"model: unreadable hair chains ({error}); get an undamaged copy") from None
