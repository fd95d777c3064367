# SPDX-License-Identifier: Apache-2.0
"""What a bake records on each groom: the material and the options that it was made with."""

import math

from pxr import Gf, Sdf, Usd, Vt

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import Material

from ...border.units import Border

KEY = "neuralocks"
"""In a groom's customData; it is composed with the points, through whatever layers come on top."""
CARRIER = "neuralocks:carrier"
"""A relationship to the skeleton that carried a groom in its bake: unlike a path in its customData, it goes where references, copies
and flattening take the two.
"""


def record(over: Sdf.PrimSpec, facts: dict) -> None:
    """Write plain values, and dictionaries of them, on a groom's spec."""
    over.SetInfo("customData", {**over.customData, KEY: facts})


def recorded(prim: Usd.Prim) -> dict:
    """What `record` wrote, with time codes, in the stage's time, and vectors as lists; empty if there is no record."""
    facts, offset, _ = _strongest(prim)
    if not isinstance(facts, dict):
        return {}

    def as_stage_has_it(value):
        if isinstance(value, Vt.DoubleArray):
            return [round(offset * code, 9) for code in value]
        return list(value) if isinstance(value, Gf.Vec3d) else value

    return {name: as_stage_has_it(value) for name, value in facts.items()}


def retimed(prim: Usd.Prim) -> list[str]:
    """The note on a bake that a stage plays at another speed."""
    _, offset, layer = _strongest(prim)
    if layer is None:
        return []
    slower = offset.scale * layer.timeCodesPerSecond / prim.GetStage().GetTimeCodesPerSecond()
    if abs(slower - 1) < 1e-6:
        return []
    return [
        f"{prim.GetPath()}: its bake is stretched to {slower:g} times its length, but its velocities and its swing are not; "
        "bake the shot as it is timed here"
    ]


def seen_as_written(prim: Usd.Prim, border: Border) -> bool:
    """Whether the stage plays a groom's bake at its own time codes, and in its own unit and axis."""
    _, offset, layer = _strongest(prim)
    return offset.IsIdentity() and (layer is None or not border.differing(layer))


def in_stage(prim: Usd.Prim) -> bool:
    """Whether a groom's bake is among the stage's own layers, not behind a reference, which may place it anywhere."""
    layer = _strongest(prim)[2]
    return layer is None or layer in prim.GetStage().GetLayerStack()


def _strongest(prim: Usd.Prim) -> tuple:
    """What the strongest layer records, its offset, and the layer: composed, a bake over another would give a mixture of both."""
    stack = prim.GetPrimStackWithLayerOffsets()
    told = ((spec.customData[KEY], offset, spec.layer) for spec, offset in stack if KEY in spec.customData)
    return next(told, (None, Sdf.LayerOffset(), None))


def given_facts(cuts: list[float] | None, joints: dict[str, str] | None) -> dict:
    """The record of the cuts, by time code, and of the joints that the user gave; empty if they were detected."""
    # Not as USD's type for time codes: for that, USD upgrades its files with a warning.
    told = {} if cuts is None else {"cuts": Vt.DoubleArray(cuts)}
    return told | ({"joints": dict(joints)} if joints else {})


def recorded_cuts(prim: Usd.Prim) -> list[float] | None:
    """The cuts recorded with a groom's bake; None if they were detected, and will be again."""
    told = recorded(prim).get("cuts")
    return told if isinstance(told, list) else None


def recorded_joint(prim: Usd.Prim) -> str | None:
    """Path of the joint that carried a groom in its bake; None if it is not recorded."""
    told = recorded(prim).get("joint")
    return told if isinstance(told, str) else None


def recorded_skeleton(prim: Usd.Prim) -> str | None:
    """Path of the skeleton that carried a groom in its bake; None if it is not recorded, or not here."""
    carrier = prim.GetRelationship(CARRIER)
    told = carrier.GetTargets() if carrier else []
    return str(told[0]) if len(told) == 1 else None


def recorded_volume(prim: Usd.Prim) -> float:
    """The stiffness against strands crowding that a simulation was made with; 0 if none is recorded."""
    told = recorded(prim).get("volume")
    return told if isinstance(told, float) and 0 <= told < math.inf else 0.0


def recorded_material(prim: Usd.Prim) -> Material | None:
    """The material of a bake; None if it is not recorded.

    Raises:
        NeuralocksError: what is recorded is not a material.
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
