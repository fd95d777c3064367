# SPDX-License-Identifier: Apache-2.0
"""When what moves a skeleton has authored samples, and which of them are poses of its body."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

Channel = tuple[Sequence[float], Callable]
"""Time codes of the samples of an attribute, or of a parent's transform, and its value at a time code."""


@dataclass(frozen=True)
class Keys:
    """Ascending time codes.

    Attributes:
        every: those of all that moves. Keys on what does not change are not motion: if they begin before it, the character would
            stand there, and hair would start with a blow.
        body: those of the joints; of the parents, if no joint moves; of all, if nothing of both does. In between, a pose is not
            one that somebody keyed, whatever a face or a parent is keyed at.
    """

    every: list[float]
    body: list[float]

    @classmethod
    def of(cls, joints: list[Channel], parents: list[Channel], face: list[Channel]) -> "Keys":
        """Those of the channels that move joints, of those that move what the skeleton is in, and of those that move a face."""
        moving, still = [set() for _ in range(3)], set()
        for own, channels in zip(moving, (joints, parents, face)):
            for times, at in channels:
                (own if changes(times, at) else still).update(times)
        every = set().union(*moving)
        last = max(every, default=-np.inf)
        every |= {time for time in still if time > last}
        return cls(sorted(every), sorted(moving[0] or moving[1] or every))

    def read(self, close: float, stand: float) -> list[float]:
        """Ascending time codes at which to read the motion: those of the body, and of the others those that lie in wider gaps than
        `close`, at least `stand` before the body's first, or after its last.
        """
        body, every = np.array(self.body), np.array(self.every)
        if len(body) < 2:
            return self.every
        after = np.searchsorted(body, every)
        gap = np.diff(body, prepend=-np.inf, append=np.inf)[after]
        apart = np.where(after == 0, body[0] - every >= stand, gap > close)
        return sorted({*self.body, *every[apart].tolist()})


def changes(times: Sequence[float], at: Callable) -> bool:
    """Whether a `Channel` has more than one value at its samples."""
    first = at(times[0]) if times else None
    return any(not np.array_equal(first, at(time)) for time in times[1:])
