# SPDX-License-Identifier: Apache-2.0
"""The skeletons of a stage besides the one that the user named. Reading a whole crowd takes as long as baking one of it, so
they are only read if a groom may be theirs or they may be the same person.
"""

from functools import cached_property

import numpy as np
from pxr import Usd

from neuralocks_core.errors import NeuralocksError

from ...skel.joints import JointSource
from ...skel.source import find_skeletons
from ...skel.stage_rig import StageRig
from ..carriers.twin_bodies import SAME, UPPER
from .skeletons import read_each_rig


class Others:
    """The other skeletons, read when they are asked for.

    Args:
        rigs: those that were named.
        stage: theirs.
        head, joints: as for `stage.read_shot`.
    """

    def __init__(self, rigs: list[StageRig], stage: Usd.Stage, head: str | None, joints: dict[str, str] | None):
        self._named, self._stage, self._given = rigs, stage, (head, joints)
        self._prims = find_skeletons(stage)
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

    def _read(self, prims: list[Usd.Prim]) -> list[StageRig]:
        """Some of the stage's skeletons, as far as they can be used."""
        head, joints = self._given
        return read_each_rig(self._stage, prims, self._named[0].border, head, joints=joints)[0]

    def _near(self, prim: Usd.Prim) -> bool:
        """Whether a joint of a skeleton is where one of a named character's upper body is, as that one's motion begins and ends."""
        try:
            source = JointSource(prim)
            for rig in self._named:
                ends = rig.time_codes[[0, -1]]
                upper = [rig.character.humanoid[name] for name in UPPER if name in rig.character.humanoid]
                places = [each.posed(ends)[:, :, :3, 3] for each in (rig.joints, source)]
                apart = np.abs(places[0][:, upper, None] - places[1][:, None]).max(axis=(0, 3))
                if apart.min(initial=np.inf) * rig.border.metres_per_unit < SAME:
                    return True
        except NeuralocksError:  # it could not be read either
            pass
        return False
