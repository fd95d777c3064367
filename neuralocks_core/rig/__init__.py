# SPDX-License-Identifier: Apache-2.0
"""Rigged mesh hair: joint chains below the head, and the tiny network that turns them (paper section 4.4)."""

from neuralocks_core.rig.chain_finding import find_chains
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.network import RigModel, RigSampler, rig_spec
from neuralocks_core.rig.rigging import assemble_rig

__all__ = [
    "HairChains",
    "RigModel",
    "RigSampler",
    "assemble_rig",
    "find_chains",
    "rig_spec",
]
