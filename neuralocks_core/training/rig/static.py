# SPDX-License-Identifier: Apache-2.0
"""Training the tiny quasi-static network of a rig without any data: random neck poses, energy as loss (paper
section 4.4).
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch

from neuralocks_core.progress import Progress, silent, within
from neuralocks_core.rig.network import RigModel, rig_spec
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.rig.rods import RigMaterial
from neuralocks_core.training.descent import Descended
from neuralocks_core.training.rig.contact import HairOnBodies, contact_weight
from neuralocks_core.training.rig.learning import trained
from neuralocks_core.training.rig.network import TinyNet
from neuralocks_core.training.rig.report import static_report
from neuralocks_core.training.threads import threads

_POOL = 512
"""Number of poses to draw from."""
_ROOM = 0.01
"""Kept from the body beyond the material's margin while learning [m]: the network sees neither the body's shape nor its arms and
is not exact to the millimetre, so hair goes less deep into the body with this."""
_COLLISION = 0.3
"""Factor on the body's stiffness."""
_LEARNING = 700
"""Thousandths of the work that are learning, by default; the rest is the report."""


@threads(1)
def train_static(
    rig: HairRig,
    material: RigMaterial = RigMaterial(),
    *,
    seconds: float = 75.0,
    steps: int | None = None,
    hidden: int = 16,
    seed: int = 0,
    batch: int = 32,
    report_poses: int = 1000,
    begin: RigModel | None = None,
    keep: Callable[[RigModel], None] | None = None,
    progress: Progress | None = None,
) -> RigModel:
    """Train the quasi-static network of one rig.

    Args:
        rig: chains, hair vertices and body.
        material: constants of the energy.
        seconds: time to train.
        steps: in place of the time; the result is then repeatable.
        hidden: width of both layers (the paper's 16), unless `begin` decides it.
        seed: decides poses and initial weights.
        batch: poses per step.
        report_poses: held-out poses of the report; 0 leaves it out.
        begin: a quasi-static model of the same chains to train on: with smaller steps, and contact counts fully from the first.
        keep: called with the model before its report is measured.
        progress: called with (done, total, message); may raise to stop.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    spec = rig_spec()
    say = progress or silent
    say(0, 1, "posing bodies")
    roomy = replace(material, margin=material.margin + _ROOM)
    held = HairOnBodies(rig, roomy, _POOL, rng, spec)
    net = TinyNet(begin.hidden if begin else hidden, held.pool, spec)

    def losses(done: float) -> dict[str, torch.Tensor]:
        elastic, collision = held.parts(net, batch)
        felt = contact_weight(1.0 if begin else done)
        return {"elastic": elastic.mean(), "collision": felt * _COLLISION * collision.mean()}

    def show(state: Descended) -> None:
        say(int(_LEARNING * state.done), 1000, f"energy {sum(state.losses.values()):.3f} m^2/s^2")

    model = trained(
        net, losses, seconds=seconds, steps=steps, begin=begin, decay=0.0, chains=rig.chains, material=material,
        method="quasi-static, self-supervised", settings={"seed": seed, "batch": batch}, show=show, keep=keep,
    )  # fmt: skip
    if report_poses:
        model.report.update(static_report(model, rig, material, report_poses, seed + 1, within(say, _LEARNING, 1000)))
    return model
