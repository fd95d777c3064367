# SPDX-License-Identifier: Apache-2.0
"""Prim paths as callers give them: as text or as USD's own, and with the slash that shells put at the end of a folder."""

from collections.abc import Iterable

from pxr import Sdf, Usd

from neuralocks_core.errors import NeuralocksError

SOME = 5
"""Prims that a message names."""


def prim_path(given, name: str) -> str | None:
    """One path as text; None if none is given.

    Raises:
        NeuralocksError: it is not a path; `name` is the argument's.
    """
    if given is None:
        return None
    if not isinstance(given, str | Sdf.Path):
        raise NeuralocksError(f"{name}: {given!r} is not a prim path; give text such as /Hero/Hair, or an Sdf.Path")
    text = str(given)
    return text[:-1] if len(text) > 1 and text.endswith("/") else text


def some_paths(prims: list[Usd.Prim], none: str = "none") -> str:
    """Paths of the first SOME prims, and how many more there are; `none` if there are none."""
    more = f" and {len(prims) - SOME} more" if len(prims) > SOME else ""
    return (", ".join(str(prim.GetPath()) for prim in prims[:SOME]) or none) + more


def prim_paths(given, name: str) -> list[str]:
    """Several paths as text, or a single one."""
    alone = isinstance(given, str) or not isinstance(given, Iterable)
    return [prim_path(each, name) for each in ([given] if alone else given)]
