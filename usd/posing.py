# SPDX-License-Identifier: Apache-2.0
"""One groom's points at any time code: a pure function of the shot and the model."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from neuralocks_core.materials import Material
from neuralocks_core.runtime import StrandModel
from neuralocks_core.strands import Carrier, strand_set

from .curves import rest_points
from .stage import StageGroom

BLOCK = 4096
"""Strands that one thread takes at a time; a multiple of what the runtime takes."""

STILL = 1e-6
"""A groom moved by less than this [m] has not moved: its points are then written bit for bit."""


class GroomPoser:
    """Deforms one groom of a shot.

    Args:
        item: the groom.
        model: the strand model.
        material: what the hair is made of.
        strength: motion strength; 0 is the held pose.
        resolve: push hair out of the body after the network.
        jobs: threads; the result does not depend on it.
    """

    def __init__(
        self,
        item: StageGroom,
        model: StrandModel,
        material: Material | None = None,
        *,
        strength: float = 1.0,
        resolve: bool = False,
        jobs: int = 1,
    ):
        self.item = item
        self._attachment = attachment = item.attachment
        self._character = character = attachment.character
        self.strands = strand_set(
            item.groom, character.canonical_to_bind[:3, 3], character.head_centre, character.facing
        )
        self.carrier = Carrier(item.groom, self.strands)
        self._material = (material or Material()).log_ratios()
        self._strength = strength
        self._sampler = model.sampler(character, attachment.rig.clip)
        self._session = model.prepare(self.strands)
        self._session.anchor(self._sampler.held_bind(self._material))
        self._session.codes = None  # needed for the first layer only; 15 MB of a large groom
        self._resolver = None
        if resolve and character.body is not None:
            from neuralocks_core.resolve import Resolver

            self._resolver = Resolver(character, self.strands)
        self._pool = ThreadPoolExecutor(max(1, jobs), thread_name_prefix="pose")
        self._ends = np.concatenate([item.groom.starts, [len(item.groom.points)]])
        self._centre = character.canonical_to_bind[:3, 3].astype(np.float32)
        low, high = item.groom.points.min(axis=0), item.groom.points.max(axis=0)
        self._corners = np.array(
            [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
        )

    def close(self) -> None:
        """Let the threads go."""
        self._pool.shutdown()

    def __enter__(self) -> "GroomPoser":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def displacement(self, time_code: float) -> np.ndarray:
        """The network's displacement (S, 24, 3) float32 [m] in canonical space, resolved if so wanted."""
        joints = self._attachment.rig.joints_at(time_code)
        return self._resolved(self._session.displacement(self._vector(time_code, joints)), time_code, joints)

    def points(self, time_code: float) -> np.ndarray:
        """The groom's points (P, 3) float32 at a time code, in the prim's own space and units."""
        groom, rig = self.item.groom, self._attachment.rig
        joints = rig.joints_at(time_code)
        vector = self._vector(time_code, joints)
        to_local = np.linalg.inv(rig.border.to_core @ self.item.placement.at(time_code)) @ self._character.carrying(
            joints
        )
        rest = self._rest_in_place(to_local)
        whole = None
        if self._resolver is not None:
            whole = self._resolved(self._session.displacement(vector), time_code, joints)
        linear = to_local[:3, :3].astype(np.float32)
        origin = (to_local[:3, :3] @ self._centre.astype(float) + to_local[:3, 3]).astype(np.float32)
        result = np.empty((len(groom.points), 3), np.float32)

        def block(strands: slice) -> None:
            here = slice(self._ends[strands.start], self._ends[strands.stop])
            moved = whole[strands] if whole is not None else self._session.displacement(vector, strands)
            out = result[here]
            self.carrier.carry(moved, out=out, strands=strands)
            if rest is not None:
                # What the network did not move keeps the author's own bits.
                out -= groom.points[here]
                out[:] = rest[here] + out @ linear.T
            else:
                out -= self._centre
                out[:] = out @ linear.T + origin

        count = groom.strand_count
        for _ in self._pool.map(block, [slice(low, min(low + BLOCK, count)) for low in range(0, count, BLOCK)]):
            pass
        return result

    def _vector(self, time_code: float, joints: np.ndarray) -> np.ndarray:
        seconds = self._attachment.rig.border.seconds([time_code])
        return self._sampler.vectors(seconds, self._material, self._strength, joints[None])[0]

    def _resolved(self, displacement: np.ndarray, time_code: float, joints: np.ndarray) -> np.ndarray:
        if self._resolver is None:
            return displacement
        rig = self._attachment.rig
        shape = rig.clip.shape_at(rig.border.seconds([time_code]))[0]
        return self._resolver.displacement(displacement, joints, shape)

    def _rest_in_place(self, to_local: np.ndarray) -> np.ndarray | None:
        """The authored rest points (P, 3) if the groom as a whole stands where it rests."""
        home = np.linalg.inv(self._attachment.to_bind)
        shift = self._corners @ (to_local - home)[:3, :3].T + (to_local - home)[:3, 3]
        scale = np.cbrt(abs(np.linalg.det(home[:3, :3])))
        return rest_points(self.item.prim) if np.abs(shift).max() < STILL * scale else None
