# SPDX-License-Identifier: Apache-2.0
"""What a network reads of the body, and where in its input: plain numbers that every model file holds."""

from dataclasses import asdict, dataclass, fields
from functools import cached_property
from operator import index

import numpy as np

from neuralocks_core.anatomy.humanoid import SEMANTIC
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.measures import MEASURES

POSE_JOINTS = ("neck", "upper_chest", "left_shoulder", "right_shoulder", "left_upper_arm", "right_upper_arm")
MATERIALS = 4
LONGEST = 2000
"""Steps that a history may cover: a minute. Each vector costs memory for all of them."""


@dataclass(frozen=True)
class BoundarySpec:
    """What the network reads of the body, and at which times.

    Attributes:
        dt: the model's own time step [s].
        bins: how many steps each history sample averages over, newest first; `(1,) * 30` is the paper's N =
            30, `()` the static variant.
        pose_joints: semantic joints whose rotation relative to the head is read.
        linear: history of the head's linear motion: "gravity" (effective gravity), "velocity" (in head axes) or "none".
        chest: whether the upper chest's angular velocity is in the history beside the head's.
        taper: share of the history, at its old end, that fades to nothing so that no echo follows a stop.

    Raises:
        NeuralocksError: a value is impossible, or of another kind.
    """

    dt: float = 1 / 30
    bins: tuple[int, ...] = (1,) * 12 + (2,) * 8 + (4,) * 5
    pose_joints: tuple[str, ...] = POSE_JOINTS
    linear: str = "gravity"
    chest: bool = True
    taper: float = 0.65

    def __post_init__(self):
        try:
            object.__setattr__(self, "bins", tuple(index(b) for b in self.bins))
            object.__setattr__(self, "pose_joints", tuple(self.pose_joints))
            self._check()
        except NeuralocksError:
            raise
        except (TypeError, ValueError, OverflowError):  # whose own messages mean nothing to a user
            raise NeuralocksError(
                "model: its boundary history has values of a wrong kind; get an undamaged copy"
            ) from None

    def _check(self) -> None:
        if not 1e-4 < self.dt < 1 or min(self.bins, default=1) < 1 or self.steps > LONGEST:
            raise NeuralocksError(
                "model: its history has an impossible time step or bin; get an undamaged copy of the model"
            )
        if not self.pose_joints:
            raise NeuralocksError("model: it reads the pose of no joint; get an undamaged copy of the model")
        if not 0 <= self.taper <= 1 or not isinstance(self.chest, bool):
            raise NeuralocksError(
                "model: its history has an impossible taper or chest; get an undamaged copy of the model"
            )
        if self.linear not in ("gravity", "velocity", "none") or not set(self.pose_joints) <= set(SEMANTIC):
            raise NeuralocksError(
                "model: it reads something of the body that this version does not know; update neuralocks"
            )

    @classmethod
    def from_json(cls, values: dict) -> "BoundarySpec":
        """Build it from the output of `to_json`.

        Raises:
            NeuralocksError: a value is impossible, or known only to a later version.
        """
        known = {f.name for f in fields(cls)}
        if not isinstance(values, dict):
            raise NeuralocksError(
                "model: its boundary history is not a list of names and values; get an undamaged copy"
            )
        if unknown := set(values) - known:
            raise NeuralocksError(f"model: its boundary history has '{min(unknown)}', unknown here; update neuralocks")
        return cls(**values)

    def to_json(self) -> dict:
        """Plain values for the model file."""
        return asdict(self)

    @property
    def per_bin(self) -> int:
        """Numbers per history bin."""
        return 3 * ((self.linear != "none") + 1 + self.chest)

    @property
    def feels_wind(self) -> bool:
        """Whether there is a place for wind: a history of effective gravity."""
        return bool(self.bins) and self.linear == "gravity"

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Where pose, gravity, shape, material and history lie in the vector."""
        sizes = {
            "pose": 6 * len(self.pose_joints),
            "gravity": 3,
            "shape": len(MEASURES),
            "material": MATERIALS,
            "history": self.per_bin * len(self.bins),
        }
        ends = np.cumsum(list(sizes.values()))
        return {name: slice(int(end) - size, int(end)) for (name, size), end in zip(sizes.items(), ends, strict=True)}

    @property
    def size(self) -> int:
        """Length of the vector."""
        return self.slices["history"].stop

    @property
    def steps(self) -> int:
        """How many earlier steps of `dt` the history covers."""
        return sum(self.bins)

    @property
    def bin_weights(self) -> np.ndarray:
        """Weight of each history bin (n,): 1, falling as a cosine to 0 over the last `taper` of the history."""
        if not self.bins:
            return np.zeros(0)
        middle = np.cumsum(self.bins) - np.asarray(self.bins) / 2
        into = np.clip((middle / self.steps - (1 - self.taper)) / max(self.taper, 1e-9), 0, 1)
        return 0.5 + 0.5 * np.cos(np.pi * into)
