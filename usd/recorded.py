# SPDX-License-Identifier: Apache-2.0
"""What a bake tells of itself, on each groom: the material and the options that it was made with."""

from pxr import Sdf, Usd

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import Material

KEY = "neuralocks"
"""In a groom's customData; it is composed with the points, through whatever layers come on top."""


def record(over: Sdf.PrimSpec, facts: dict) -> None:
    """Write plain values, and dictionaries of them, on a groom's spec."""
    over.SetInfo("customData", {**over.customData, KEY: facts})


def recorded(prim: Usd.Prim) -> dict:
    """What `record` wrote, empty where nothing did."""
    # The strongest layer's alone: composed, a bake over another one would tell a mixture of both.
    told = (spec.customData[KEY] for spec in prim.GetPrimStack() if KEY in spec.customData)
    facts = next(told, None)
    return dict(facts) if isinstance(facts, dict) else {}


def recorded_material(prim: Usd.Prim) -> Material | None:
    """The material of a bake, None where it is not told.

    Raises:
        NeuralocksError: what is told is no material.
    """
    values = recorded(prim).get("material")
    if values is None:
        return None
    try:
        return Material(**values)
    except (NeuralocksError, TypeError) as error:
        raise NeuralocksError(
            f"{prim.GetPath()}: customData '{KEY}' has no material that can be read ({error}); bake again, or name it with "
            "--material"
        ) from None
