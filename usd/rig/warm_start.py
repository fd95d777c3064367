# SPDX-License-Identifier: Apache-2.0
"""The model that `rig train --begin` trains on: whether it can be, its material, and how it was made."""

from neuralocks_core.errors import NeuralocksError, about
from neuralocks_core.rig import HairChains, RigModel, rig_spec
from neuralocks_core.rig.network import MAX_ANGLE

from ..border.amounts import check_number

LOWEST, HIGHEST = 1e-6, 1e4
"""Range of a material's bend, weight and damping."""
_FEW = 4
"""Up to this many chains are named in an error."""
_MADE = ("command", "steps", "seconds", "seed", "clips", "began with")


class Beginning:
    """A model file to train on.

    Args:
        path: the file.
        dynamic: the kind of the training.
        hidden: width that the training was asked for.

    Raises:
        NeuralocksError: it cannot be read, or its network is of another kind.
    """

    def __init__(self, path, dynamic: bool, hidden: int | None):
        self._path, self.model = path, RigModel.load(path)
        kind, width = "dynamic" if self.model.dynamic else "quasi-static", self.model.hidden
        if self.model.dynamic != dynamic:
            raise NeuralocksError(f"--begin {path}: it is {kind}; train with --{kind}, or begin with another model")
        if hidden is not None:
            raise NeuralocksError(f"--hidden: the model of --begin has layers of {width}; leave one of the two out")
        built = (self.model.spec, [len(bias) for _, bias in self.model.layers[:-1]], self.model.max_angle)
        if built != (rig_spec(dynamic), [width] * 2, MAX_ANGLE):
            raise NeuralocksError(
                f"--begin {path}: its network is built differently from this one; begin with another model"
            )

    def material(self) -> dict:
        """The constants that it was trained with, which are those of the training unless it is told others."""
        known = self.model.training.get("material")
        known = known if isinstance(known, dict) else {}
        chosen = {name: known[name] for name in ("bend", "weight", "damping") if name in known}
        with about(self._path):
            for name, value in chosen.items():
                check_number(f"model: its {name}", value, LOWEST, HIGHEST)
        return chosen

    def check(self, here: HairChains) -> None:
        """Refuse a model for other chains than these."""
        with about(self._path):
            self.model.chains.check_same(here)
            own = self.model.chains
            if own.names == here.names:
                return
            known = [name for name in here.names if name in own.names]
            named = " ".join(f"--chains {name}" for name in own.tops[:_FEW]) + " ..." * (len(own.tops) > _FEW)
            # It was trained for some of the chains, or in some order of the file: only the former can be asked for.
            remedy = f"name its chains as in its training ({named}), or train" if tuple(known) == own.names else "train"
            raise NeuralocksError(
                f"model: its {len(own)} joints are not the {len(here)} of this rig in the same order; {remedy} without --begin"
            )

    def card(self) -> dict:
        """How it was made."""
        return {name: self.model.training[name] for name in _MADE if name in self.model.training}
