# SPDX-License-Identifier: Apache-2.0
"""Which frames the samples of a layer are made of, and when these frames are no longer needed."""

from collections.abc import Iterator, Sequence
from itertools import count

from .stencils import Stencils


class Uses:
    """The frames that a layer's samples need; samples are counted in the order in which they are put into it.

    Args:
        plans: for each batch, what the samples of each groom need.

    Attributes:
        spent: ascending; for each frame, the number of samples after which it is used up.
    """

    def __init__(self, plans: Sequence[Sequence[Stencils]]):
        self._after: list[dict[float, int]] = [{} for _ in plans]
        puts = count(1)
        for after, some in zip(self._after, plans, strict=True):
            for plan in some:
                for _, _, needs in plan.puts:
                    after |= dict.fromkeys(needs, next(puts))
        frames = sorted((place, number, code) for number, a in enumerate(self._after) for code, place in a.items())
        self.spent = [place for place, *_ in frames]
        self._waiting = iter(frames)
        self._next = next(self._waiting, None)

    def codes(self, batch: int) -> list[float]:
        """Ascending time codes at which points of a batch are needed."""
        return sorted(self._after[batch])

    def over(self, batch: int, code: float, puts: int) -> bool:
        """Whether a frame is used up after this many samples."""
        return self._after[batch][code] <= puts

    def used_up(self, puts: int) -> Iterator[tuple[int, float]]:
        """Batch and time code of the frames that are used up after this many samples, each frame once."""
        while self._next is not None and self._next[0] <= puts:
            yield self._next[1:]
            self._next = next(self._waiting, None)
