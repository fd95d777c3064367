# SPDX-License-Identifier: Apache-2.0
"""Ways by which curves without a binding may lie in a rig's bind pose; `seat` says which one it is."""

from collections.abc import Callable

import numpy as np

from neuralocks_core.rotation import flat

from ...border.placement import Placement
from ...skel.stage_rig import StageRig
from ...skel.surface import StageMesh
from ..strands.curves import lone_sample

STEADY = 1e-4
"""A prim that drifts no more than this relative to something is moved by it."""
ABOUT, ROUNDED = 10.0, 0.01
"""A drift is a share of the prim's distance from the origin, but of at most ABOUT metres or, since far positions are rounded, of
ROUNDED times that distance."""
CLEARLY = 2
"""Hair must be this many times nearer to skin by a less likely way than by a likelier one for the former to count: hair that hovers
over skin may come a little nearer by a wrong way, such as one that counts a parent's scale twice.
"""
SOME_TIMES = 16
"""About how many of a prim's samples are looked at: all would be too many."""


def ways(
    rig: StageRig,
    mesh: StageMesh | None,
    placement: Placement,
    when: float | None = None,
    *,
    likely: bool = True,
    drifts: tuple[float, float] | None = None,
) -> list[np.ndarray]:
    """Candidates (4, 4) for the way from the groom's own space to bind world, the likeliest first.

    Args:
        rig: what carries the groom.
        mesh: its skin below the groom, if it has one.
        placement: where the groom's prim stands.
        when: time code at which the groom has the points it is read with, if they are not points at rest.
        likely: those that serve unless skin says otherwise, or the others.
        drifts: the result of `drifts_of`, if it is known already.
    """
    groom = placement.reference
    still = []
    if mesh is not None and mesh.placement.usable:
        still.append(rig.to_bind @ mesh.geom_bind @ np.linalg.inv(mesh.placement.reference) @ groom)
    still += [rig.to_bind @ np.linalg.inv(rig.bind_shown) @ groom, rig.to_bind @ groom]
    if placement.brought is not None:  # another file's groom knows nothing of where the character's file puts it
        still.append(rig.border.to_core @ groom)
    if not rig.joints.animated:
        return still if likely else []
    if when is not None:  # it is seen where it is then
        return (_posed(rig, placement, when) or still) if likely else still
    with_skeleton, with_head = drifts or drifts_of(rig, placement)
    if with_skeleton <= STEADY:
        return still if likely else _elsewhere(rig, placement)
    # A prim that is moved along by its parents: where it stood relative to the head when that motion began.
    posed = _posed(rig, placement, placement.samples[0])
    if with_head <= STEADY:
        return (posed or still) if likely else still
    # A set carries along what stands and walks in it; only what nearly keeps to the head was made on it.
    both = posed + still if CLEARLY * with_head < with_skeleton else still + posed
    return both if likely else []


def _elsewhere(rig: StageRig, placement: Placement) -> list[np.ndarray]:
    """Ways of hair that stands still, made on a head that is not in the bind pose: when its exporter wrote it, when the motion or
    the shot begins.
    """
    codes = dict.fromkeys([*lone_sample(placement.prim), *placement.lone_samples, *beginnings(rig)])
    return [way for code in codes for way in _posed(rig, placement, code)]


def rest_way(rig: StageRig, placement: Placement, when: float | None, drifts: tuple[float, float] | None):
    """The way (4, 4) of hair that stands still and was made on a head in the rest pose, in which USD shows a character without its
    animation; None of hair that moves.
    """
    if rig.joints.animated and (when is not None or (drifts or drifts_of(rig, placement))[0] > STEADY):
        return None
    return np.linalg.inv(rig.carrying_at_rest) @ rig.border.to_core @ placement.reference


def beginnings(rig: StageRig) -> list[float]:
    """Time codes at which the motion begins, and the shot begins, if that is after a run-up."""
    (first, last), stage = rig.time_codes[[0, -1]].tolist(), rig.joints.prim.GetStage()
    start = stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else first
    return [first, start] if first < start <= last else [first]


def _posed(rig: StageRig, placement: Placement, when: float) -> list[np.ndarray]:
    """The way of a groom that lies right on the head as it is at a time code; none if a scale of zero hides the head then."""
    carrying = rig.carrying_at(when)
    if flat(carrying[:3, :3]):
        return []
    return [np.linalg.inv(carrying) @ rig.border.to_core @ placement.at(when)]


def drifts_of(rig: StageRig, placement: Placement) -> tuple[float, float]:
    """How much a prim moves relative to a skeleton, and to its head; (0, 0) if either stands still, infinity for the head if the
    skeleton's place moves the prim.
    """
    if not placement.samples or not rig.joints.animated:
        return 0.0, 0.0
    about = ABOUT / rig.border.metres_per_unit
    with_skeleton = _drift(placement, rig.joints.placement.at, about)
    if with_skeleton <= STEADY:
        return with_skeleton, np.inf
    return with_skeleton, _drift(
        placement, lambda time: rig.border.from_core @ rig.carrying_at(time) @ rig.border.to_core, about
    )


def _drift(placement: Placement, against: Callable[[float], np.ndarray], about: float) -> float:
    """How much a moving prim moves relative to something else in stage space, as a share: 0 if that is what moves it; infinity if a
    scale of zero hides that all the while. `about` is ABOUT in units of the stage.
    """
    times = placement.samples[:: max(1, len(placement.samples) // SOME_TIMES)]
    places, others = (np.stack([at(time) for time in times]) for at in (placement.at, against))
    seen = ~flat(others[:, :3, :3])
    if not seen.any():
        return np.inf
    places = places[seen]
    relative = np.linalg.inv(others[seen]) @ places
    turned, moved = (np.abs(relative - relative[0])[..., part].max() for part in (slice(3), 3))
    far = np.abs(places[..., 3]).max()
    reach = max(1.0, min(far, about), ROUNDED * far, np.abs(relative[..., 3]).max())
    return float(max(turned / np.abs(relative[0, :3, :3]).max(), moved / reach))
