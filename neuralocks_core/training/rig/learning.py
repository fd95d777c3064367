# SPDX-License-Identifier: Apache-2.0
"""How the network of a rig learns, whatever its losses: its budget, its step sizes, and what the model's card says of them."""

import time
from collections.abc import Callable
from dataclasses import asdict

from neuralocks_core.models.model_file import REMEDIES
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.network import RigModel
from neuralocks_core.rig.rods import RigMaterial
from neuralocks_core.training.descent import Descended, Losses, Schedule, descend
from neuralocks_core.training.muon import muon
from neuralocks_core.training.rig.network import TinyNet

_RATE, _RATE_ON = 3e-3, 5e-4
"""Largest rate of a training that begins with nothing, and with a model."""


def trained(
    net: TinyNet,
    losses: Losses,
    *,
    seconds: float,
    steps: int | None,
    begin: RigModel | None,
    decay: float,
    chains: HairChains,
    material: RigMaterial,
    method: str,
    settings: dict,
    show: Callable[[Descended], None],
    keep: Callable[[RigModel], None] | None,
) -> RigModel:
    """The model that a network becomes, without a report.

    Args:
        net: the network, its inputs scaled.
        losses: as for `descend`.
        seconds, steps, begin, keep: as for `train_static`.
        decay: of the weights, as for `muon`.
        chains: of the rig.
        material: that the losses are made with.
        method, settings: what the model's card says besides.
        show: called about once a second.
    """
    if begin:
        net.begin_as(begin)
    began = time.monotonic()
    rate = _RATE_ON if begin else _RATE
    schedule = Schedule(minutes=seconds / 60, steps=steps, rate=rate, warm_up=50)
    for state in descend(muon(net, rate, decay), losses, schedule, remedy=REMEDIES["rig"]):
        show(state)
    training = {
        "method": method,
        "steps": state.step,
        "seconds": round(time.monotonic() - began, 1),
        **settings,
        "hidden": net.hidden,
        "material": asdict(material),
    }
    model = net.model(chains, training)
    if keep:
        keep(model)
    return model
