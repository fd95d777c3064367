# SPDX-License-Identifier: Apache-2.0
"""What all commands share: expected errors become one line on stderr and an exit status."""

import functools
import json
import sys
from pathlib import Path

import typer

from neuralocks_core.errors import NeuralocksError

INTERRUPTED = 130


def command_of(app: typer.Typer):
    """A decorator like `app.command(name)` for functions that raise NeuralocksError."""

    def command(name: str):
        def wrap(function):
            @app.command(name)
            @functools.wraps(function)
            def run(*args, **kwargs):
                try:
                    _check_names(kwargs.values())
                    return function(*args, **kwargs)
                except NeuralocksError as error:
                    one_line(f"error: {error}")
                    raise typer.Exit(1) from None
                except KeyboardInterrupt:
                    one_line("stopped")
                    raise typer.Exit(INTERRUPTED) from None
                except BrokenPipeError:
                    raise  # the reader has seen enough: typer ends without a word
                except OSError as error:  # what reads and writes names its own file; this is a full or closed stdout
                    one_line(f"error: {error.filename or 'output'}: {error.strerror or error}; write it elsewhere")
                    raise typer.Exit(1) from None
                except MemoryError:
                    one_line("error: not enough memory; work on fewer strands at a time, or on a larger machine")
                    raise typer.Exit(1) from None

            return run

        return wrap

    return command


def _check_names(values) -> None:
    """Refuse files whose names are no text: USD takes UTF-8 alone, whatever the disk allows."""
    for value in values:
        for path in value if isinstance(value, list) else [value]:
            try:
                str(path if isinstance(path, Path) else "").encode()
            except UnicodeEncodeError:
                name = str(path).encode("utf-8", "backslashreplace").decode()
                raise NeuralocksError(f"{name}: its name is not UTF-8, as USD needs; rename it") from None


def one_line(text) -> None:
    """Print to stderr, without line breaks."""
    print(" ".join(str(text).split()), file=sys.stderr)


def note(notes) -> None:
    """Print what a user should know."""
    for text in notes:
        one_line(f"note: {text}")


def print_json(value) -> None:
    """Print a plain value for a machine to read."""
    typer.echo(json.dumps(value, indent=1, default=str))
