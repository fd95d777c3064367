# SPDX-License-Identifier: Apache-2.0
"""Shared by all commands: expected errors become one line on stderr and an exit status."""

import functools
import importlib
import inspect
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import typer

from neuralocks_core.errors import CannotWrite, NeuralocksError
from neuralocks_core.json_values import plain

from ..border.stopping import deferred, stoppable, stopped
from ..border.told_once import told_once

LONGEST_LINE = 10_000
"""Characters of a message; paths may have thousands."""


def command_of(app: typer.Typer):
    """A decorator like `app.command(name)` for functions that raise NeuralocksError; `usd` says whether they need USD."""

    def command(name: str, usd: bool = True):
        def wrap(function):
            @app.command(name, help=_paragraphs(function.__doc__))
            @functools.wraps(function)
            def run(*args, **kwargs):
                try:
                    with stoppable():
                        _check_words(function, kwargs, usd)
                        if usd:
                            _load_usd()
                        return function(*args, **kwargs)
                except NeuralocksError as error:
                    one_line(f"error: {error}")
                    raise typer.Exit(1) from None
                except (MemoryError, RuntimeError) as error:
                    if not _out_of_memory(error):
                        raise
                    one_line("error: not enough memory; work on fewer strands at a time, or on a larger machine")
                    raise typer.Exit(1) from None

            return run

        return wrap

    return command


def _out_of_memory(error: Exception) -> bool:
    """Whether Python ran out of memory, or torch, which has no exception type of its own for CPU memory."""
    words = ("can't allocate memory", "not enough memory", "OutOfMemoryError")
    return isinstance(error, MemoryError) or any(word in f"{type(error).__name__} {error}" for word in words)


def _load_usd() -> None:
    """Load all USD modules that commands need: Ctrl-C in the middle would be lost, and leave modules half loaded."""
    with deferred():
        for name in ("Ar", "Gf", "Sdf", "Tf", "Usd", "UsdGeom", "UsdSkel", "UsdUtils", "Vt"):
            importlib.import_module(f"pxr.{name}")


def _paragraphs(text: str) -> str:
    """A docstring without the line breaks of the source, so that the terminal wraps it."""
    return "\n\n".join(" ".join(part.split()) for part in inspect.cleandoc(text).split("\n\n"))


def _check_words(function, given: dict, usd: bool) -> None:
    """Refuse empty words, such as an unset variable of a script leaves, and files whose names are not text: USD takes only UTF-8,
    whatever the disk allows.
    """
    for name, value in given.items():
        for word in value if isinstance(value, list) else [value]:
            if isinstance(word, str | Path) and not str(word).strip():
                needed = inspect.signature(function).parameters[name].default is inspect.Parameter.empty
                remedy = "give a value" if needed else "give a value, or leave it out"
                raise NeuralocksError(f"{_as_typed(function, name)}: is empty; {remedy}")
            for path in _paths(word, usd):
                try:
                    str(path).encode()
                except UnicodeEncodeError:
                    raise _unreadable(path) from None


def _paths(word, usd: bool) -> list[Path]:
    """A file as its user names it and, since USD asks for that, its absolute path; nothing for what is not a file."""
    if not isinstance(word, Path):
        return []
    with suppress(OSError):  # the current folder may be gone
        return [word, Path(os.path.abspath(word))] if usd else [word]
    return [word]


def _unreadable(path: Path) -> NeuralocksError:
    """The error for a file name that did not come in as text."""
    try:
        name = os.fsencode(path).decode("utf-8")
    except UnicodeError:
        name = str(path).encode("utf-8", "backslashreplace").decode()
        return NeuralocksError(f"{name}: its name is not UTF-8, as USD needs; rename it")
    return NeuralocksError(f"{name}: its name is UTF-8, but the locale is not; set LC_ALL=C.UTF-8")


def _as_typed(function, name: str) -> str:
    """An argument's name, or an option with its dashes."""
    told = inspect.signature(function).parameters[name].annotation.__metadata__[0]
    if isinstance(told, typer.models.ArgumentInfo):
        return name
    words = [word for word in (told.default, *(told.param_decls or ())) if isinstance(word, str)]
    return max(words, key=len, default=f"--{name.replace('_', '-')}")


def say(text) -> None:
    """Print a result to stdout, without what would steer a terminal: names come from files."""
    typer.echo("\n".join(map(_harmless, str(text).split("\n"))))


def one_line(text) -> None:
    """Print to stderr, without line breaks, without what would steer a terminal, and not without end."""
    line = _harmless(" ".join(str(text).split()))
    print(line if len(line) <= LONGEST_LINE else f"{line[:LONGEST_LINE]}...", file=sys.stderr)


def _harmless(line: str) -> str:
    return "".join(each if each.isprintable() else "?" for each in line)


def note(notes) -> None:
    """Print notes for the user; notes that are the same for many prims are printed once."""
    for text in told_once(notes):
        one_line(f"note: {text}")


@contextmanager
def noting_when_cut_short(notes: Callable[[], list[str]]) -> Iterator[None]:
    """In this block, Ctrl-C or a full disk also prints what a user should know about the work that is left."""
    try:
        yield
    except BaseException as error:
        if stopped() or isinstance(error, CannotWrite):
            note(notes())
        raise


def counted(number: int, thing: str) -> str:
    """A number and the thing counted, in words."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def print_json(value) -> None:
    """Print a plain value as JSON for a machine to read; NaN becomes null."""
    typer.echo(json.dumps(plain(value), indent=1, default=str))
