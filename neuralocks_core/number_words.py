# SPDX-License-Identifier: Apache-2.0
"""Numbers that users write as words."""


def plain_number(word, kind=float):
    """The number, of `kind` float or int, that a word states; a number is only converted.

    Raises:
        ValueError: it is not a number, or only Python reads it as one: 1_0 and digits of other scripts are taken for typing errors.
    """
    if isinstance(word, str) and ("_" in word or not word.isascii()):
        raise ValueError(f"{word!r} is not a number")
    return kind(word)
