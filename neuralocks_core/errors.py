# SPDX-License-Identifier: Apache-2.0
"""The error for users' mistakes, in one line."""

from contextlib import contextmanager


class NeuralocksError(ValueError):
    """Bad input: the message names the prim, file or argument, the fact, and the remedy.

    Command line and add-on show the message as it is; anything else that escapes is a bug.
    """


class CannotWrite(NeuralocksError):
    """The file system refuses, a full disk say: nothing is wrong with the input, and what is finished is worth keeping."""


@contextmanager
def about(subject):
    """Errors of what is done meanwhile begin with the subject: the path of the file that is read, say."""
    try:
        yield
    except NeuralocksError as error:
        raise NeuralocksError(f"{subject}: {error}") from None
