# SPDX-License-Identifier: Apache-2.0
"""Numbers that users write as words."""


def plain_number(word, kind=float):
    """The number, of `kind` float or int, that a word is; what is a number already is only converted.

    Raises:
        ValueError: it is none, or one that Python alone takes for it: 1_0, or digits of other scripts, are slips of the pen.
    """
    if isinstance(word, str) and ("_" in word or not word.isascii()):
        raise ValueError(f"{word!r} is not a number")
    return kind(word)
