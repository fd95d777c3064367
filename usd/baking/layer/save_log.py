# SPDX-License-Identifier: Apache-2.0
"""A log that takes a crate file back to one of its saves, after a kill during a later save or after a power cut.

A save appends values where the tables of the previous save began, writes new tables behind them, and then a new header that
points there. So to restore a save, the file is cut where that save's tables began, and these and the header are written
again. The log keeps both for every save, one line each.
"""

import base64
import bisect
import json
import mmap
import struct
import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

HEADER = 88
"""Bytes of a crate file's header, which holds the offset of the table of contents."""

_PAGE = 1 << 12
_ALIGNED = 1 << 16
"""Mappings begin at a multiple of this many bytes, as Windows requires."""
_WINDOW = 1 << 23
"""Bytes that are mapped at a time: they count as memory of the process."""


_BYTES = "header", "tables"


@dataclass(frozen=True)
class _Save:
    """The content of a line.

    Attributes:
        puts: how often something had been put into the file by then.
        spent: how many frames are no longer needed after it.
        header: the file's first bytes.
        end: where the values end and the tables begin.
        tables: the rest of the file.
        begin: where the values of this save begin.
        trace: checksum of these values.
    """

    puts: int
    spent: int
    header: bytes
    end: int
    tables: bytes
    begin: int
    trace: int


class SaveLog:
    """The log of one crate file.

    Args:
        path: the log's own file.
        plan: what the file will hold, as one word; a log of another plan is ignored.
        spent: ascending; for each frame, the number of puts after which nothing needs it.
    """

    def __init__(self, path: Path, plan: str, spent: Sequence[int]):
        self._path, self._plan, self._spent = path, plan, spent
        self._end = HEADER

    def begin(self) -> None:
        """Start anew. Raises OSError."""
        self._end = HEADER
        self._path.unlink(missing_ok=True)  # other hard links to the file keep their content
        self._path.write_text(_line({"plan": self._plan}))

    def add(self, file: Path, puts: int) -> bool:
        """Record a file's state after a save; False if its format is unknown, such as a later USD's. Raises OSError."""
        try:
            header, end, tables = _tables(file)
        except (ValueError, struct.error):
            return False
        begin, self._end = self._end, end
        save = _Save(puts, bisect.bisect_right(self._spent, puts), header, end, tables, begin, _trace(file, begin, end))
        with open(self._path, "a") as log:
            log.write(_line(asdict(save) | {name: base64.b64encode(getattr(save, name)).decode() for name in _BYTES}))
        return True

    def restore(self, file: Path) -> int:
        """Take a file back to its last save whose values are all there, and forget the later ones.

        Returns:
            How often something had been put into it by then; 0 if there is nothing to resume from.

        Raises:
            OSError: it cannot be read or written.
        """
        first, *saves = _lines(self._path)
        if first != {"plan": self._plan}:
            return 0
        whole = []
        for save in map(_save, saves):
            if save is None or save.begin != self._end or _trace(file, save.begin, save.end) != save.trace:
                break
            whole.append(save)
            self._end = save.end
        if not whole:
            return 0
        last = whole[-1]
        with open(file, "r+b") as part:
            part.truncate(last.end)
            part.seek(last.end)
            part.write(last.tables)
            part.seek(0)
            part.write(last.header)
        kept = "".join(_line(line) for line in [first, *saves[: len(whole)]])
        changed = self._path.with_suffix(".part")
        changed.write_text(kept)
        changed.replace(self._path)
        return last.puts


def spent_frames(path: Path) -> int:
    """How many frames are used up, according to a log."""
    saves = [_save(line) for line in _lines(path)[1:]]
    return saves[-1].spent if saves and saves[-1] else 0


def _tables(file: Path) -> tuple[bytes, int, bytes]:
    """Header of a crate file, where its tables begin, and the tables. Raises ValueError or struct.error if it is not one."""
    with open(file, "rb") as crate:
        header = crate.read(HEADER)
        if len(header) < HEADER or not header.startswith(b"PXR-USDC"):
            raise ValueError(f"{file} has no header of a crate file")
        crate.seek(struct.unpack_from("<q", header, 16)[0])
        (count,) = struct.unpack("<Q", crate.read(8))
        sections = struct.iter_unpack("<16sqq", crate.read(32 * min(count, 64)))  # name, place, size
        end = min(place for _, place, _ in sections)
        crate.seek(end)
        return header, end, crate.read()


def _trace(file: Path, begin: int, end: int) -> int | None:
    """Checksum of the bytes from `begin` to before `end`; None if the file is shorter. It covers the sum of each page's words,
    because a power cut loses whole pages and no single word of a page is sure to be nonzero; and all of the first page, which was
    written before.
    """
    if file.stat().st_size < end:
        return None
    with open(file, "rb") as crate:
        crate.seek(begin)
        trace = zlib.crc32(crate.read(min(end - begin, -begin % _PAGE)))
        pages = begin + -begin % _PAGE
        for low in range(begin // _ALIGNED * _ALIGNED, end, _WINDOW):
            size = min(_WINDOW, end - low)
            with mmap.mmap(crate.fileno(), size, offset=low, access=mmap.ACCESS_READ) as window:
                words = np.frombuffer(window, np.uint64, size // 8)[max(0, pages - low) // 8 :]
                sums = np.add.reduceat(words, np.arange(0, len(words), _PAGE // 8))
                del words  # a mapping with a live view cannot be closed
                trace = zlib.crc32(window[size // 8 * 8 :], zlib.crc32(sums, trace))
    return trace


def _line(facts: dict) -> str:
    text = json.dumps(facts)
    return f"{zlib.crc32(text.encode()):08x} {text}\n"


def _lines(path: Path) -> list[dict | None]:
    """What the lines say, up to the first incomplete one; at least one item, None if there is no such file."""
    found: list[dict | None] = []
    try:
        for line in path.read_text(errors="replace").splitlines():
            facts = json.loads(line[9:])
            if _line(facts) != line + "\n":
                break
            found.append(facts)
    except (OSError, ValueError, RecursionError):
        pass
    return found or [None]


def _save(facts: dict) -> _Save | None:
    """The save that a line describes, or None if it does not describe one."""
    try:
        save = _Save(**facts | {name: base64.b64decode(facts[name]) for name in _BYTES})
        numbers = [save.puts, save.spent, save.end, save.begin, save.trace]
    except (TypeError, KeyError, ValueError):
        return None
    right = all(type(number) is int and number >= 0 for number in numbers) and save.begin <= save.end
    return save if right and len(save.header) == HEADER else None
