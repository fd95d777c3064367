# SPDX-License-Identifier: Apache-2.0
"""The potentials, each by name, of which self-supervised training minimises the sum (paper section 3.4, equation 1). The
solver that other trainings learn from has its own form of them, `reference/kernels/energy.py`.
"""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from neuralocks_core.materials import COLLISION, MARGIN, STRETCH, Material
from neuralocks_core.physics.adhesion import adhesion
from neuralocks_core.physics.bend_twist import Cosserat, bend_twist
from neuralocks_core.physics.body_collision import body_collision
from neuralocks_core.physics.gravity import gravity
from neuralocks_core.physics.hair_style import hair_style
from neuralocks_core.physics.inertia import damping, inertia
from neuralocks_core.physics.rods import Rods
from neuralocks_core.physics.stretch import stretch


@dataclass(frozen=True)
class Surroundings:
    """What acts on the strands at one moment; None switches a potential off.

    Attributes:
        gravity: (..., 3) in head axes [m/s^2].
        planes: (..., S, K, 4) nearest body plane, see `body_collision`.
        margin: (S, K) or a number [m].
        distance: (..., S, K) to the body, for the style [m].
        neighbours: (S, K, N), see `adhesion`.
        before: (..., S, K, 3) points one step ago, in the head's current frame [m].
        before2: (..., S, K, 3) points two steps ago, in the head's current frame [m].
        moved_before: (..., S, K, 3) points one step ago, in the head's frame at that time [m].
        dt: step [s].
    """

    gravity: Tensor | None = None
    planes: Tensor | None = None
    margin: Tensor | float = MARGIN
    distance: Tensor | None = None
    neighbours: Tensor | None = None
    before: Tensor | None = None
    before2: Tensor | None = None
    moved_before: Tensor | None = None
    dt: float = 1 / 30


@dataclass(frozen=True)
class Stiffness:
    """Constants, per unit line density; numbers or tensors (..., S, 1). See the module of each for the unit."""

    stretch: float | Tensor = STRETCH
    bend: float | Tensor = Material.bend
    weight: float | Tensor = Material.weight
    damping: float | Tensor = Material.damping
    clumping: float | Tensor = Material.clumping
    collision: float | Tensor = COLLISION
    style: float | Tensor = 0.0
    inertia: float = 1.0


def energies(
    x: Tensor,
    rods: Rods,
    around: Surroundings,
    stiffness: Stiffness = Stiffness(),
    *,
    form: Cosserat = Cosserat.EXACT,
    paper_adhesion: bool = False,
) -> dict[str, Tensor]:
    """Every potential of the strands except self-collision, which costs more than all others and is summed over fewer poses.

    Args:
        x: (..., S, K, 3) points in canonical space [m].
        rods: the strands at rest.
        around: gravity, body, neighbours and the past.
        stiffness: constants.
        form: of the bend-twist potential.
        paper_adhesion: the paper's form, without the rest offset.

    Returns:
        Energy per unit line density of each strand, (..., S) [m^3/s^2], by name. Divided by the strand's length
        it is an energy per unit mass [m^2/s^2].
    """
    terms = {
        "stretch": stretch(x, rods, stiffness.stretch),
        "bend_twist": bend_twist(x, rods, stiffness.bend, form),
    }
    if around.gravity is not None:
        terms["gravity"] = gravity(x, rods, around.gravity, stiffness.weight)
    if around.before is not None and around.before2 is not None:
        terms["inertia"] = stiffness.inertia * inertia(x, around.before, around.before2, rods, around.dt)
    if around.moved_before is not None:
        terms["damping"] = stiffness.inertia * damping(x, around.moved_before, rods, around.dt, stiffness.damping)
    if around.planes is not None:
        terms["body_collision"] = body_collision(x, rods, around.planes, stiffness.collision, around.margin)
    if around.distance is not None:
        terms["hair_style"] = hair_style(x, rods, around.distance, stiffness.style)
    if around.neighbours is not None:
        terms["adhesion"] = adhesion(x, rods, around.neighbours, stiffness.clumping, paper=paper_adhesion)
    return terms
