# SPDX-License-Identifier: Apache-2.0
"""The skeletons of a stage besides the one that the user named. Reading a whole crowd takes as long as baking one of it, so
they are only read if a groom may be theirs or they may be the same person.
"""

from collections.abc import Callable
from functools import cached_property

import numpy as np
from pxr import Usd

from neuralocks_core.errors import NeuralocksError

from ..skel.joints import JointSource
from ..skel.stage_rig import StageRig
from .alike import SAME, UPPER

Read = Callable[[list[Usd.Prim]], list[StageRig]]


class Others:
    """The other skeletons, read when they are asked for.

    Args:
        rigs: those that were named.
        prims: all Skeletons of the stage.
        read: reads some of them, as far as they can be used.
    """

    def __init__(self, rigs: list[StageRig], prims: list[Usd.Prim], read: Read):
        self._named, self._read = rigs, read
        self._prims = prims
        self._paths = {rig.path for rig in rigs}

    def __bool__(self) -> bool:
        return len(self._prims) > len(self._paths)

    @cached_property
    def rigs(self) -> list[StageRig]:
        """All of them that can be used."""
        # All at once: whether one without a named head is used depends on whether the others have one.
        return [rig for rig in self._read(self._prims) if rig.path not in self._paths]

    def maybe_same(self) -> list[StageRig]:
        """Those that may be the same person as a named one: body and head, or clothes."""
        if "rigs" in self.__dict__:
            return self.rigs
        near = [prim for prim in self._prims if str(prim.GetPath()) not in self._paths and self._near(prim)]
        return self._read(near) if near else []

    def _near(self, prim: Usd.Prim) -> bool:
        """Whether a joint of a skeleton is where one of a named character's upper body is, as that one's motion begins and ends."""
        try:
            source = JointSource(prim)
            for rig in self._named:
                ends = rig.time_codes[[0, -1]]
                upper = [rig.character.humanoid[name] for name in UPPER if name in rig.character.humanoid]
                places = [each.posed(ends)[:, :, :3, 3] for each in (rig.source, source)]
                apart = np.abs(places[0][:, upper, None] - places[1][:, None]).max(axis=(0, 3))
                if apart.min(initial=np.inf) * rig.border.metres_per_unit < SAME:
                    return True
        except NeuralocksError:  # it could not be read either
            pass
        return False
