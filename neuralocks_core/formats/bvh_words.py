# SPDX-License-Identifier: Apache-2.0
"""The words of a BVH file, one after another, and its frames as numbers."""

import codecs
import re
from pathlib import Path

import numpy as np

from neuralocks_core.errors import NeuralocksError

LARGEST_FILE = 256 * 2**20
"""Bytes; an hour of motion at 120 frames a second is about that."""
LARGEST = 1e6
"""Largest length allowed in a file, in its own unit."""
LONGEST_NUMBER = 64
"""Characters; an array of words is as wide as its longest one."""
PIECE = 1 << 15
"""Bytes of the frames that are converted to numbers at a time, plus the rest of the line, at most twice as many."""
_COMMENT = re.compile(rb"(?<![^\r\n])[ \t]*(?:#|//)[^\r\n]*")
_WORD, _BREAK, _LINE = re.compile(_COMMENT.pattern + rb"|(\S+)"), re.compile(rb"\s"), re.compile(rb"[\r\n]")
_ANY, _WHOLE_LINE = re.compile(rb"\S+"), re.compile(rb"[^\r\n]+")
_UTF16 = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16", b"H\0": "utf-16-le", b"\0H": "utf-16-be"}
"""First bytes of a file -> its encoding."""


class Words:
    """The file's words one by one, without comment lines (`#`, `//`), with errors that name the file."""

    def __init__(self, path: Path):
        self.path = path
        try:
            if not path.is_file():
                raise self.error("no such file", "check the path")
            if path.stat().st_size > LARGEST_FILE:
                raise self.error(f"larger than {LARGEST_FILE} bytes", "cut the take")
            self._content = path.read_bytes().removeprefix(codecs.BOM_UTF8)
        except OSError as error:
            raise self.error(f"cannot be read ({error.strerror})", "check its permissions") from None
        if wide := _UTF16.get(self._content[:2]):
            self._content = self._content.decode(wide, "replace").encode()
        # One after another: the words of a hostile file never become millions of Python objects.
        self._found, self._place = _WORD.finditer(self._content), 0
        self._rest = ""

    def error(self, fact: str, remedy: str = "export it again as BVH") -> NeuralocksError:
        return NeuralocksError(f"{self.path}: {fact}; {remedy}")

    def next(self) -> str:
        if self._rest:
            word, self._rest = self._rest, ""
            return word
        word = next((found for found in self._found if found[1]), None)
        if word is None:
            raise self.error("ends in the middle")
        self._place = word.end()
        return word[0].decode("utf-8", "replace")

    @property
    def left(self) -> int:
        """Bytes after the last word."""
        return len(self._content) - self._place

    def expect(self, word: str) -> None:
        found = self.next()
        if found.lower() != word.lower():
            raise self.error(f"'{found[:40]}' stands where '{word}' should")

    def label(self, label: str) -> None:
        """Expect words and a colon, which may be separate from them and directly before what follows."""
        found = self.next()
        while ":" not in found and label.lower().startswith(found.lower()):
            found += f" {self.next()}"
        before, _, self._rest = found.partition(":")
        if before.strip().lower() != label.lower():
            raise self.error(f"'{found[:40]}' stands where '{label}:' should")

    def number(self) -> float:
        word = self.next()
        try:
            value = float(word)
        except ValueError:
            raise self.error(f"'{word[:40]}' stands where a number should") from None
        if not abs(value) <= LARGEST:
            raise self.error(f"holds the number {word[:40]}")
        return value

    def count(self, highest: int, what: str) -> int:
        word = self.next()
        if not word.isdecimal() or len(word) > 9 or int(word) > highest:
            raise self.error(f"says {word[:40]} {what}, where 0 to {highest} are possible")
        return int(word)

    def in_longest_line(self) -> int:
        """How many words the longest of all following lines holds; there is one."""
        lines = _WHOLE_LINE.finditer(self._content, self._place)
        return max(sum(1 for _ in _ANY.finditer(line[0])) for line in lines if not _COMMENT.fullmatch(line[0]))

    def numbers(self, most: int) -> tuple[np.ndarray, bool]:
        """All that follows as numbers (n,), at most `most` of them, and whether there is more."""
        values, start, more = [np.zeros(0)], self._place, False
        while most and start < len(self._content):
            gap = _LINE.search(self._content, start + PIECE, start + 2 * PIECE)
            gap = gap or _BREAK.search(self._content, start + 2 * PIECE)
            end = gap.start() if gap else len(self._content)
            block = self._content[start:end]
            if b"#" in block or b"//" in block:
                block = _COMMENT.sub(b"", block)
            block = block.split()
            block, more = block[:most], len(block) > most
            if max(map(len, block), default=0) > LONGEST_NUMBER:
                raise self.error(f"its frames hold a number of more than {LONGEST_NUMBER} characters")
            try:
                values.append(np.array(block, bytes).astype(float))
            except ValueError as error:
                raise self.error(f"its frames hold something that is not a number ({str(error)[:80]})") from None
            start, most = end, most - len(block)
        return np.concatenate(values), more or _ANY.search(self._content, start) is not None
