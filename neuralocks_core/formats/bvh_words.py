# SPDX-License-Identifier: Apache-2.0
"""The words of a BVH file, one after the other, and its frames as numbers."""

import re
from pathlib import Path

import numpy as np

from neuralocks_core.errors import NeuralocksError

LARGEST_FILE = 256 * 2**20
"""Bytes; an hour of motion at 120 frames a second is about that."""
LARGEST = 1e6
"""No length in a file, in its own unit, is larger."""
LONGEST_NUMBER = 64
"""Characters; an array of words is as wide as its longest one."""
PIECE = 1 << 16
"""Bytes of the frames that are made numbers at a time."""
_WORD, _BREAK = re.compile(rb"\S+"), re.compile(rb"\s")


class Words:
    """The file's words one by one, with errors that name it."""

    def __init__(self, path: Path):
        self.path = path
        try:
            if not path.is_file():
                raise self.error("no such file", "check the path")
            if path.stat().st_size > LARGEST_FILE:
                raise self.error(f"larger than {LARGEST_FILE} bytes", "cut the take")
            self._content = path.read_bytes()
        except OSError as error:
            raise self.error(f"cannot be read ({error.strerror})", "check its permissions") from None
        # One after the other: the words of a hostile file never become millions of Python objects.
        self._found, self._place = _WORD.finditer(self._content), 0

    def error(self, fact: str, remedy: str = "export it again as BVH") -> NeuralocksError:
        return NeuralocksError(f"{self.path}: {fact}; {remedy}")

    def next(self) -> str:
        word = next(self._found, None)
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

    def numbers(self, most: int) -> np.ndarray:
        """All that follows as numbers (n,), or so many of them where there are more."""
        values, start = [np.zeros(0)], self._place
        while most and start < len(self._content):
            gap = _BREAK.search(self._content, start + PIECE)
            end = gap.start() if gap else len(self._content)
            block = self._content[start:end].split()[:most]
            if max(map(len, block), default=0) > LONGEST_NUMBER:
                raise self.error(f"its frames hold a number of more than {LONGEST_NUMBER} characters")
            try:
                values.append(np.array(block, bytes).astype(float))
            except ValueError as error:
                raise self.error(f"its frames hold what is no number ({str(error)[:80]})") from None
            start, most = end, most - len(block)
        return np.concatenate(values)
