# SPDX-License-Identifier: Apache-2.0
"""A groom: all strands of one hairstyle at rest, exactly as authored."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from neuralocks_core.errors import NeuralocksError

# Farther than this from the origin, it is not hair on a character, and float32 no longer resolves a millimetre.
LARGEST_COORDINATE = 1e4
WIDTH = 8e-5
"""Of a hair, if nobody says [m]."""


@dataclass(frozen=True, eq=False)
class Groom:
    """Strands at rest in metres, world space of the bind pose, Y up.

    Vertex counts and strand order are the author's and never change: a bake writes back exactly this
    topology. Strands with fewer than two distinct points stay in the groom; `strands.strand_set.StrandSet.valid` keeps
    them out of the network.

    Arrays are converted to the stated types and made read-only: copied, unless nobody can write to them already.

    Raises:
        NeuralocksError: a shape does not fit, a value is not finite, a width is negative, or there is no strand.
    """

    name: str
    """What messages call the groom: a prim path or a file name."""
    points: np.ndarray
    """(P, 3) float32 [m], strand after strand, root first."""
    counts: np.ndarray
    """(S,) int32, vertices of each strand; they sum to P."""
    widths: np.ndarray = None  # type: ignore[assignment]
    """(P,), (S,) or (1,) float32 [m], the diameter; left out means 0.08 mm everywhere."""
    root_uv: np.ndarray | None = None
    """(S, 2) float32, the texture coordinate of the root on the scalp mesh, for shading only."""
    guides: np.ndarray | None = None
    """(S,) bool, true for the strands that other tools should treat as guides."""
    group: np.ndarray | None = None
    """(S,) int32, a number for each named part of the hairstyle."""

    def __post_init__(self) -> None:
        self._put("points", self._array("points", self.points, np.float32))
        self._put("counts", self._whole_numbers("counts", self.counts))
        self._check_topology()
        self._check_values("points", self.points, LARGEST_COORDINATE, "m")

        strands, total = len(self.counts), len(self.points)
        widths = _own(WIDTH, np.float32) if self.widths is None else self._array("widths", self.widths, np.float32)
        if widths.ndim != 1 or len(widths) not in {1, strands, total}:
            raise self._error(
                f"widths have shape {widths.shape}", f"give 1, {strands} (one a strand) or {total} (one a point)"
            )
        self._check_values("widths", widths, LARGEST_COORDINATE, "m")
        if widths.size and widths.min() < 0:
            raise self._error("some widths are negative", "give diameters")
        self._put("widths", widths)
        if self.root_uv is not None:
            self._put("root_uv", self._shaped("root_uv", self._array("root_uv", self.root_uv, np.float32), 2))
            self._check_values("root_uv", self.root_uv, np.inf, "")
        if self.guides is not None:
            self._put("guides", self._shaped("guides", self._truths("guides", self.guides)))
        if self.group is not None:
            self._put("group", self._shaped("group", self._whole_numbers("group", self.group)))

    def _check_topology(self) -> None:
        if self.points.ndim != 2 or self.points.shape[1] != 3:
            raise self._error(f"points have shape {self.points.shape}", "give (P, 3)")
        if self.counts.ndim != 1:
            raise self._error(f"counts have shape {self.counts.shape}", "give one number a strand")
        if len(self.counts) == 0:
            raise self._error("holds no strands", "give a groom with at least one strand")
        if self.counts.min() < 0:
            raise self._error(f"strand {int(self.counts.argmin())} has a negative vertex count", "repair the groom")
        total = int(self.counts.sum(dtype=np.int64))
        if total != len(self.points):
            raise self._error(
                f"vertex counts sum to {total} but there are {len(self.points)} points",
                "repair the groom's topology",
            )
        if total == 0:
            raise self._error("has strands but no points", "give the strands their points")

    @property
    def strand_count(self) -> int:
        """S, the number of strands, valid or not."""
        return len(self.counts)

    @cached_property
    def starts(self) -> np.ndarray:
        """(S,) int64, index of each strand's root in `points` (of the following strand's if it has no points)."""
        ends = np.cumsum(self.counts, dtype=np.int64)
        return ends - self.counts

    @property
    def strand_of_point(self) -> np.ndarray:
        """(P,) int32, the strand that each point belongs to."""
        return np.repeat(np.arange(self.strand_count, dtype=np.int32), self.counts)

    def subset(self, strands: np.ndarray) -> Groom:
        """The groom made of the given strands only, in the given order.

        Args:
            strands: (N,) int indices or (S,) bool mask.

        Raises:
            NeuralocksError: it is neither of these, or leaves no strand.
        """
        count, strands = self.strand_count, _plain(strands)
        try:
            chosen = np.arange(count)[strands]
        except IndexError:
            chosen = None
        if chosen is None or strands.ndim != 1:
            raise self._error("a subset is not of its strands", f"give indices below {count}, or a mask ({count},)")
        counts = self.counts[chosen]
        # Index of each kept point: its strand's start, plus its place within the strand.
        within = np.arange(counts.sum(dtype=np.int64)) - np.repeat(np.cumsum(counts, dtype=np.int64) - counts, counts)
        kept = np.repeat(self.starts[chosen], counts) + within
        widths = self.widths
        if len(widths) == len(self.points) and len(self.points) > 1:
            widths = widths[kept]
        elif len(widths) == self.strand_count and self.strand_count > 1:
            widths = widths[chosen]
        pick = {
            f: None if getattr(self, f) is None else getattr(self, f)[chosen] for f in ("root_uv", "guides", "group")
        }
        return replace(self, points=self.points[kept], counts=counts, widths=widths, **pick)

    def _put(self, field: str, value: np.ndarray) -> None:
        object.__setattr__(self, field, value)

    def _shaped(self, field: str, value: np.ndarray, *each: int) -> np.ndarray:
        """The value, if it holds one entry of shape `each` per strand."""
        shape = (len(self.counts), *each)
        if value.shape != shape:
            raise self._error(f"{field} has shape {value.shape}", f"give {shape}")
        return value

    def _error(self, fact: str, remedy: str) -> NeuralocksError:
        return NeuralocksError(f"{self.name}: {fact}; {remedy}")

    def _array(self, field: str, value: object, kind: type) -> np.ndarray:
        value = _plain(value)
        if value.dtype.kind not in "biuf":
            raise self._error(f"{field} is not a plain array of numbers", "give one")
        with np.errstate(over="ignore"):
            return _own(value, kind)

    def _whole_numbers(self, field: str, value: object) -> np.ndarray:
        value = _plain(value)
        if value.size and value.dtype.kind not in "iub":
            raise self._error(f"{field} are not whole numbers", "give integers")
        # Compared in Python: a uint64 would wrap around silently on conversion.
        if value.size and not -(2**31) <= int(value.min()) <= int(value.max()) < 2**31:
            raise self._error(f"{field} do not fit 32 bits", "repair the groom")
        return _own(value, np.int32)

    def _truths(self, field: str, value: object) -> np.ndarray:
        value = _plain(value)
        if value.dtype.kind not in "biuf" or not np.isin(value, (0, 1)).all():
            raise self._error(f"{field} are neither true nor false", "give booleans")
        return _own(value, np.bool_)

    def _check_values(self, field: str, value: np.ndarray, largest: float, unit: str) -> None:
        """Check that values are finite and of plausible size; the message says where the first bad value is."""
        bad = ~(np.abs(value) <= largest) | ~np.isfinite(value)
        if not bad.any():
            return
        rows = np.flatnonzero(bad.reshape(len(value), -1).any(axis=1))
        first = value[rows[0]]
        where = f"number {rows[0]}"
        if len(value) == int(self.counts.sum(dtype=np.int64)):
            where += f" (strand {int(self.strand_of_point[rows[0]])})"
        if np.isfinite(first).all():
            wrong = (
                f"lie farther than {largest:g} {unit} from the origin"
                if value.ndim > 1
                else f"exceed {largest:g} {unit}"
            )
            raise self._error(f"{field} {wrong}, first {where}", "check the unit")
        raise self._error(f"{len(rows)} of {len(value)} {field} are not finite, first {where}", "repair the groom")


def _plain(value: object) -> np.ndarray:
    """The value as an array of whatever type; of objects if it is none."""
    try:
        return np.asarray(value)
    except (TypeError, ValueError, OverflowError):
        return np.asarray(None)


def _own(value: object, kind: type) -> np.ndarray:
    """The value as a contiguous array of a kind that nobody can write to; itself, if it is one."""
    if not (type(value) is np.ndarray and value.dtype == kind and value.flags.c_contiguous and _fixed(value)):
        value = np.array(value, kind, order="C", ndmin=1)
        value.flags.writeable = False
    return value


def _fixed(array: np.ndarray) -> bool:
    """Whether nobody can write to an array: it is read-only, and what it is a view of, too."""
    while isinstance(array, np.ndarray) and not array.flags.writeable:
        array = array.base
    return array is None
