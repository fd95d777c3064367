# SPDX-License-Identifier: Apache-2.0
"""USD's errors as one line that names the file: what cannot be written, and what is damaged."""

import functools
import inspect
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pxr import Tf

from neuralocks_core.errors import CannotWrite, NeuralocksError


def names_damage(function):
    """A decorator: USD's errors in a function become one line that names its first argument, a path or what was read.

    A damaged file may open and still have values that cannot be unpacked: USD says so when they are read.
    """
    arguments = inspect.signature(function)

    @functools.wraps(function)
    def run(*args, **kwargs):
        try:
            return function(*args, **kwargs)
        except (Tf.ErrorException, UnicodeDecodeError) as error:  # the latter from names in a damaged crate file
            source = next(iter(arguments.bind(*args, **kwargs).arguments.values()))
            source = getattr(source, "shot", source)
            path = getattr(source, "path", source)
            raise NeuralocksError(
                f"{path}: it, or a file it uses, is damaged ({first_line(error)}); export it again"
            ) from None

    return run


@contextmanager
def named(out: Path) -> Iterator[None]:
    """Turns USD's errors while a file is written into one line that names the file."""
    try:
        yield
    except Tf.ErrorException as error:
        raise CannotWrite(
            f"{out}: cannot be written ({first_line(error)}); check the folder and the space on its disk"
        ) from None


def first_line(error: Exception) -> str:
    """The message of a USD error without USD's own source positions."""
    if isinstance(error, UnicodeDecodeError):
        return "holds bytes that are not UTF-8"
    try:
        text = str(error)
    except UnicodeDecodeError as no_text:  # USD quotes what it cannot read
        return first_line(no_text)
    found = re.search(r" : '(.*?)'\s*$", text, re.MULTILINE | re.DOTALL)
    lines = (found.group(1) if found else text).strip().splitlines() or ["unknown error"]
    return lines[0].strip().rstrip(".")[:200]


def text_of(error) -> str:
    """The whole message of a USD error, with bytes that are not UTF-8 as numbers."""
    try:
        return str(error)
    except UnicodeDecodeError as no_text:
        return no_text.object.decode("utf-8", "backslashreplace")
