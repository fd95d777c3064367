# SPDX-License-Identifier: Apache-2.0
"""Points of grooms at any time code: a pure function of the shot and the model."""

from collections.abc import Sequence

import numpy as np

from neuralocks_core.deformation.resolve import Resolver, reach
from neuralocks_core.deformation.root_skin import RootSkin
from neuralocks_core.deformation.strand_session import StrandSession
from neuralocks_core.errors import about
from neuralocks_core.materials import Material
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.strands.strand_set import StrandSet
from neuralocks_core.wind import Wind

from ...shot.stage import StageGroom
from .memory import LARGE, give_back, preparing
from .placing import GroomPlacer


class GroomPoser:
    """Deforms grooms of a shot with a model.

    Args:
        items: grooms of one head, which share the work for its body and motion.
        model: the strand model; its threads share the work, and the result does not depend on them.
        material: what the hair is made of.
        strength: motion strength; 0 is the held pose.
        wind: in core axes.
        resolve: push hair out of the body after the network.
        loop: the clip repeats, its last sample shows the pose of its first.
    """

    def __init__(
        self,
        items: Sequence[StageGroom],
        model: StrandModel,
        material: Material | None = None,
        *,
        strength: float = 1.0,
        wind: Wind | None = None,
        resolve: bool = True,
        loop: bool = False,
    ):
        attachment, self._model = items[0].attachment, model
        character, self._rig = attachment.character, attachment.rig
        self._material = (material or Material()).log_ratios()
        self._strength, self._wind = strength, wind
        self._sampler = model.sampler(character, self._rig.cycle if loop else self._rig.clip)
        self._resolvers: list[tuple[slice | np.ndarray, Resolver]] = []
        with preparing():  # or 150 MB of a large groom would stay allocated
            self._placers = [GroomPlacer(item) for item in items]
            sets = [placer.strands for placer in self._placers]
            self._session = StrandSession(model, StrandSet.joined(sets))
            ends = np.cumsum([0, *(len(each.rest) for each in sets)])
            self._rows = [slice(first, end) for first, end in zip(ends, ends[1:])]  # of each groom among all strands
            self._session.anchor(self._sampler.held_bind(self._material))
            self._skin = RootSkin(character, sets, self._rig.clip)
            begun = self._skin.begun(self.strands)
            if resolve and character.body is not None:
                self._resolvers = [
                    (rows, Resolver(character, begun.subset(rows), self._rig.clip)) for rows in self._alike()
                ]
                with about(self._rig.path):
                    for _, resolver in self._resolvers:
                        resolver.prepare()

    @property
    def strands(self) -> StrandSet:
        """All grooms, one after the other, as the network sees them."""
        return self._session.strands

    def points(self, time_code: float) -> np.ndarray:
        """Points (P, 3) float32 at a time code of all grooms, one after the other, each in its prim's own space and units."""
        joints, (first, *others) = self._rig.joints_at(time_code), self._placers
        if not (self._resolvers or self._skin.moves or others):
            placed = first.at(time_code, joints)
            self._session.each(self._vector(time_code, joints), placed.put)
            return placed.points
        moved = self._displacement(time_code, joints)
        # A chunk's points overwrite its displacement if there are as many of them.
        in_place = all(placer.same_size for placer in self._placers)
        ends = np.cumsum([0, *(placer.item.point_count for placer in self._placers)])
        points = moved.reshape(-1, 3) if in_place else np.empty((ends[-1], 3), np.float32)
        for placer, rows, first, end in zip(self._placers, self._rows, ends, ends[1:]):
            placed, own = placer.at(time_code, joints, points[first:end]), moved[rows]

            def put(strands: slice, placed=placed, own=own) -> None:
                placed.put(strands, own[strands].copy())

            self._model.by_chunk(put, len(own))
        return points

    def moved(self, time_code: float) -> np.ndarray:
        """Displacement (S, 24, 3) float32 [m] of the network's vertices, in canonical space."""
        return self._displacement(time_code, self._rig.joints_at(time_code))

    def _displacement(self, time_code: float, joints: np.ndarray) -> np.ndarray:
        moved = self._session.displacement(self._vector(time_code, joints))
        shape = self._rig.shape_at(time_code)
        self._skin.carry(moved, shape, lambda moved: self._push(moved, joints, shape))
        if self._resolvers and moved.nbytes > LARGE:
            give_back()  # 20 MB for a few percent of the time: this frame is written while the next one is posed
        return moved

    def _push(self, moved: np.ndarray, joints: np.ndarray, shape: np.ndarray) -> None:
        """Push displaced strands out of the body, in place."""
        for rows, resolver in self._resolvers:
            part = moved[rows]
            resolver.apply(part, joints, shape, self._model.by_chunk)
            if not isinstance(rows, slice):  # a slice gives a view
                moved[rows] = part

    def _alike(self) -> list[slice | np.ndarray]:
        """Strands grouped by the part of the body in their groom's reach: each groom is moved as if it were alone."""
        found: dict[float, list] = {}
        for placer, rows in zip(self._placers, self._rows):
            far = reach(placer.item.attachment.character, placer.strands)
            found.setdefault(far, []).append(np.arange(rows.start, rows.stop))
        return [slice(None)] if len(found) == 1 else [np.concatenate(rows) for rows in found.values()]

    def _vector(self, time_code: float, joints: np.ndarray) -> np.ndarray:
        seconds = self._rig.border.seconds([time_code])
        return self._sampler.vectors(seconds, self._material, self._strength, joints[None], self._wind)[0]
