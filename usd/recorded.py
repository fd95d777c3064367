# SPDX-License-Identifier: Apache-2.0
"""What a bake tells of itself, on each groom: the material and the options that it was made with."""

from pxr import Sdf, Usd, Vt

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


def cut_facts(cuts) -> dict:
    """What a bake tells of the cuts, by time code, that its user gave; nothing where they were found."""
    return {} if cuts is None else {"cuts": Vt.DoubleArray([float(cut) for cut in cuts])}


def recorded_cuts(prims: list[Usd.Prim]) -> list[float] | None:
    """The cuts that the bake of any of these grooms tells of; None where they were found, and will be again."""
    told = [cuts for prim in prims if isinstance(cuts := recorded(prim).get("cuts"), Vt.DoubleArray)]
    return [float(cut) for cut in told[0]] if told else None


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
