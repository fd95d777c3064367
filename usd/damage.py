# SPDX-License-Identifier: Apache-2.0
"""A damaged USD file may open and still have values that cannot be unpacked: USD says so when they are read."""

import functools

from pxr import Tf

from neuralocks_core.errors import NeuralocksError

from .border import first_line


def names_damage(function):
    """A decorator: USD's errors in a function become one line that names its first argument, a path or what was read."""

    @functools.wraps(function)
    def run(source, *args, **kwargs):
        try:
            return function(source, *args, **kwargs)
        except Tf.ErrorException as error:
            source = getattr(source, "shot", source)
            path = getattr(source, "path", source)
            raise NeuralocksError(
                f"{path}: it, or a file it uses, is damaged ({first_line(error)}); export it again"
            ) from None

    return run
