# SPDX-License-Identifier: Apache-2.0
"""The error for users' mistakes, in one line."""

from contextlib import contextmanager


class NeuralocksError(ValueError):
    """Bad input: the message names the prim, file or argument, the fact, and the remedy.

    Command line and add-on show the message unchanged; any other exception that escapes is a bug.
    """


class CannotWrite(NeuralocksError):
    """The file system refuses, such as a full disk: the input is fine, and finished work is worth keeping."""


def fact_of(error: BaseException) -> str:
    """What another library's error says, in one line; its type if it says nothing."""
    return (str(error).strip() or type(error).__name__).splitlines()[0]


def reworded(error: NeuralocksError, text: str) -> NeuralocksError:
    """The same error with another message: its type and attributes tell what it is about."""
    error.args = (text,)
    return error


@contextmanager
def about(subject):
    """Prefix errors raised in this block with the subject, such as the path of the file being read."""
    try:
        yield
    except NeuralocksError as error:
        raise NeuralocksError(f"{subject}: {error}") from None
