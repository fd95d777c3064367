# SPDX-License-Identifier: Apache-2.0
"""Energy of hair joint chains as rods, with the collision of the skinned mesh (paper section 4.4), differentiable.

Per unit of mass [m^2/s^2], zero at rest. Bones do not stretch, so the remaining rod potentials are
gravity, and bend-twist with the joints' own rotations as the material frame: Omega = 2 / l Im(q), q the turn of
a joint from rest (paper eq. 3 with q^0 = 1).
"""

import numpy as np
import torch

from neuralocks_core.character import levels
from neuralocks_core.materials import LINEAR
from neuralocks_core.motion import G
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.rig.rods import RigMaterial, RodTree
from neuralocks_core.training.rig.body import rest_clearance
from neuralocks_core.training.rig.poses import PosePool

COLLIDING = 500
"""Hair vertices at most that collide, spread evenly over all."""


class RigEnergy(torch.nn.Module):
    """Energy of turns of a rig's hair joints.

    Args:
        rig: chains and skinned vertices.
        material: constants.
        dtype: of the computation.
    """

    def __init__(self, rig: HairRig, material: RigMaterial, dtype=torch.float32):
        super().__init__()
        chains = rig.chains
        self.material = material
        tree = RodTree(chains, material)
        chosen = np.linspace(0, len(rig.points) - 1, min(COLLIDING, len(rig.points))).astype(int)
        self.chosen = chosen

        def keep(name, values):
            self.register_buffer(name, torch.as_tensor(np.asarray(values), dtype=dtype))

        keep("mass", tree.mass)
        keep("stiffness", tree.stiffness)
        keep("support", tree.support)
        keep("origins", chains.origins)
        keep("bones", chains.bones)
        keep("rest_ends", chains.origins[chains.bone_joint] + chains.bones)
        keep("points", rig.points[chosen])
        keep("weights", rig.weights[chosen])
        # Vertices that rest on the skin, or in it, are not pushed.
        keep("margins", np.minimum(material.margin, rest_clearance(rig, rig.points[chosen])))
        self.bone_joint = torch.as_tensor(chains.bone_joint.astype(np.int64))
        by_depth = levels(chains.parents)
        self.levels = [torch.as_tensor(level) for level in by_depth]
        self.ups = [torch.as_tensor(chains.parents[level].astype(np.int64)) for level in by_depth]
        self.order = torch.argsort(torch.cat(self.levels))

    def draw(self, rng: np.random.Generator, count: int) -> torch.Tensor:
        """Indices of at most `count` colliding vertices, without repetition."""
        return torch.as_tensor(rng.choice(len(self.chosen), min(count, len(self.chosen)), replace=False))

    def pose(self, quaternions: torch.Tensor):
        """Turns (B, N, 4) wxyz, canonical -> rotations (B, N, 3, 3), positions (B, N, 3), bone ends (B, M, 3) [m]."""
        matrices = _matrices(quaternions)
        rotations, positions, where = [], [], {}
        for level, up in zip(self.levels, self.ups):
            if not rotations:
                turn, place = matrices[:, level], self.origins[level].expand(len(matrices), -1, 3)
            else:
                row = torch.as_tensor([where[int(u)] for u in up])
                carrier = rotations[-1][:, row]
                turn = carrier @ matrices[:, level]
                way = self.origins[level] - self.origins[up]
                place = positions[-1][:, row] + torch.einsum("bnij,nj->bni", carrier, way)
            where.update({int(j): i for i, j in enumerate(level)})
            rotations.append(turn)
            positions.append(place)
        rotation, position = torch.cat(rotations, 1)[:, self.order], torch.cat(positions, 1)[:, self.order]
        ends = position[:, self.bone_joint] + torch.einsum("bmij,mj->bmi", rotation[:, self.bone_joint], self.bones)
        return rotation, position, ends

    def skin(self, rotation, position, chosen=None) -> torch.Tensor:
        """Hair vertices (B, V, 3) [m] by linear blend skinning; all, or the chosen ones (of `draw`).

        Args:
            rotation, position: of the joints, as `pose` gives them.
            chosen: indices of vertices.
        """
        weights, points = (self.weights, self.points) if chosen is None else (self.weights[chosen], self.points[chosen])
        count = len(rotation)
        shift = position - torch.einsum("bnij,nj->bni", rotation, self.origins)
        moved = torch.cat([rotation, shift[..., None]], dim=-1).reshape(count, -1, 12)
        rest = torch.eye(3, 4, dtype=moved.dtype).reshape(1, 1, 12).expand(count, 1, 12)
        blended = (weights @ torch.cat([rest, moved], dim=1)).reshape(count, -1, 3, 4)
        return torch.einsum("bvij,vj->bvi", blended[..., :3], points) + blended[..., 3]

    def parts(self, pool: PosePool, poses, quaternions, gravity, some=None) -> tuple[torch.Tensor, torch.Tensor]:
        """Elastic and collision energy, (B,) each, for turns (B, N, 4) in poses (B,) of the pool.

        Args:
            pool: posed bodies; poses: which of them, (B,) int.
            quaternions: the turns, wxyz, canonical.
            gravity: its directions in the head's frame, (B, 3) numpy.
            some: which hair vertices collide; all if left out. Their planes come from the current state itself.
        """
        rotation, position, ends = self.pose(quaternions)
        elastic = self.elastic(quaternions, torch.as_tensor(gravity, dtype=ends.dtype) * G, ends)
        if not pool.collides:
            return elastic, torch.zeros_like(elastic)
        points = self.skin(rotation, position, some)
        normals, offsets = pool.planes(poses, points.detach().numpy())
        return elastic, self.collision(points, torch.as_tensor(normals), torch.as_tensor(offsets), some)

    def depths(self, pool: PosePool, poses, quaternions) -> np.ndarray:
        """How deep in the body the deepest hair vertex is, (B,) [m], less than zero outside; those that rest in the body do not
        count. Arguments as of `parts`.
        """
        rotation, position, _ = self.pose(quaternions)
        points = self.skin(rotation, position).numpy()
        normals, offsets = pool.planes(poses, points)
        depth = offsets - np.einsum("bvi,bvi->bv", normals, points)
        return np.where(self.margins > 0, depth, -np.inf).max(axis=1)

    def elastic(self, quaternions, gravity, ends) -> torch.Tensor:
        """Gravity and bend-twist (B,) [m^2/s^2] of turns (B, N, 4) wxyz, whose bones end at `ends` (B, M, 3) [m];
        `gravity` (B, 3) in the head's frame [m/s^2].
        """
        bend = 2 * (quaternions[..., 1:].square().sum(-1) * self.stiffness).sum(-1)
        moved = ends - self.rest_ends
        fall = (moved * (self.mass[:, None] * gravity[:, None] * self.material.weight + self.support)).sum((-1, -2))
        return bend - fall

    def collision(self, points, normals, offsets, chosen=None) -> torch.Tensor:
        """Body collision (B,) [m^2/s^2] of vertices (B, V, 3) [m] against planes, mean over vertices.

        A plane's `normals` (B, V, 3) n and `offsets` (B, V) d [m] give the distance n.x - d; `chosen` as in `skin`.
        """
        margins = self.margins if chosen is None else self.margins[chosen]
        depth = torch.relu(margins - ((points * normals).sum(-1) - offsets))
        cubic = depth.clamp(max=LINEAR).pow(3) + 3 * LINEAR * LINEAR * (depth - LINEAR).clamp(min=0)
        return self.material.collision * cubic.mean(-1)


def bounded_turns(raw: torch.Tensor, max_angle: float) -> torch.Tensor:
    """`rig.kinematics.half_turns` for torch: (..., 3) -> unit quaternions (..., 4) wxyz."""
    size = float(np.sin(max_angle / 2))
    square = raw.square().sum(-1, keepdim=True) + 1
    scalar = torch.sqrt(1 - size * size + size * size / square)
    return torch.cat([scalar, raw * (size * square.rsqrt())], dim=-1)


def _matrices(q: torch.Tensor) -> torch.Tensor:
    w, x, y, z = q.unbind(-1)
    entries = [
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ]  # fmt: skip
    return torch.stack(entries, dim=-1).reshape(*q.shape[:-1], 3, 3)
