# SPDX-License-Identifier: Apache-2.0
"""The time steps of `solver.simulate`, one after another on a device."""

from collections.abc import Sequence

import numpy as np

from neuralocks_core.materials import NO_PLANE
from neuralocks_core.motion import G
from neuralocks_core.reference.rest import RestRods
from neuralocks_core.warp_device import start_warp

REACH = 0.1
"""[m] search radius of a vertex for the body; also how deep a vertex may sink and still be pushed out."""
NEAR = 0.02
"""[m] planes farther away are not reported."""
CHUNKS = (3, 3, 100)
"""Newton steps between two updates of body planes and neighbours. Three updates per step, for any number of iterations: at
clumping 240, strands that pull on each other are up to 2.7 mm from where they would settle, at 60 about 0.1 mm."""


class Stepper:
    """State of all strands in world space. Private to the reference; `solver.simulate` checks the arguments.

    Args:
        rods: the strands at rest.
        material: bend, weight, damping and clumping, each (S,).
        neighbours: (S, N) int strands tied to each, -1 for none; N may be 0.
        margin: largest distance kept from the body [m].
        collision: stiffness of the contact [1/(m s^2)].
        gravity: [m/s^2].
        tolerance: rms net force per mass [m/s^2] below which a strand is solved.
        volume: stiffness against crowding [m^2/s^2], 0 for none.
        device: warp's name of the device.
    """

    def __init__(
        self,
        rods: RestRods,
        material: dict[str, np.ndarray],
        neighbours: np.ndarray,
        *,
        margin: float,
        collision: float,
        gravity: float,
        tolerance: float,
        volume: float,
        device: str,
    ):
        self.wp = wp = start_warp(device)
        from neuralocks_core.reference.kernels import rod as rod_kernels
        from neuralocks_core.reference.kernels import step as step_kernels

        self.rod_kernels, self.kernels = rod_kernels, step_kernels
        self.device = wp.get_device(device)
        self.strands, self.vertices = rods.mass.shape
        self.widest, self.tolerance = margin, tolerance
        self.gravity, self.wind = wp.vec3d(0.0, -gravity, 0.0), wp.vec3d()
        self._upload_strands(rods, material, neighbours)
        self.support = self._vectors(rods.support * (gravity / G))
        self._empty_state(margin, collision)
        self.mesh, self.volume = None, None
        if volume > 0:
            from neuralocks_core.reference.volume import Volume

            self.volume = Volume(self.rest, self.constants.mass, volume)

    def _upload_strands(self, rods: RestRods, material: dict[str, np.ndarray], neighbours: np.ndarray) -> None:
        """Upload what stays the same for the whole simulation."""
        from neuralocks_core.reference.kernels import energy as energy_kernels

        wp = self.wp
        self.rest = self._vectors(rods.points)
        self.constants = energy_kernels.Rods()
        self.constants.length = self._reals(rods.length)
        self.constants.mass = self._reals(rods.mass)
        self.constants.curl = self._vectors(rods.curl)
        # 2 B / l: energy B/2 l |2/l (b - b0)|^2 per interior vertex, l half its adjacent edges, which is its mass
        self.constants.bend = self._reals(2.0 * material["bend"][:, None] / rods.mass)
        self.weight = wp.array(material["weight"], dtype=wp.float64, device=self.device)
        self.damping = wp.array(material["damping"], dtype=wp.float64, device=self.device)
        self.clumping = wp.array(material["clumping"], dtype=wp.float64, device=self.device)
        self.clumped = neighbours.shape[1] > 0
        self.neighbours = wp.array(np.ascontiguousarray(neighbours.T), dtype=wp.int32, device=self.device)
        if not self.clumped:
            self.neighbours = wp.empty((0, self.strands), dtype=wp.int32, device=self.device)

    def _empty_state(self, margin: float, collision: float) -> None:
        """Allocate the arrays that every step writes, with no body near."""
        from neuralocks_core.reference.kernels import banded as banded_kernels
        from neuralocks_core.reference.kernels import energy as energy_kernels

        wp = self.wp
        shape = (self.vertices, self.strands)
        self.x, self.last, self.before = (self._empty(wp.vec3d, shape) for _ in range(3))
        self.moved, self.moved_before = (self._empty(wp.vec3d, shape) for _ in range(2))
        self.tension = self._empty(wp.float64, shape)
        self.load = energy_kernels.Load()
        self.load.target, self.load.pull = self._empty(wp.vec3d, shape), self._empty(wp.float64, shape)
        self.load.plane = wp.array(np.full((*shape, 4), NO_PLANE), dtype=wp.vec4d, device=self.device)
        self.load.margin = wp.array(np.full(shape, margin), dtype=wp.float64, device=self.device)
        self.load.collision = collision
        self.seen, self.corner = self._empty(wp.vec3d, shape), self._empty(wp.vec2, shape)
        self.clear = wp.array(np.full(shape, -1e3), dtype=wp.float64, device=self.device)
        self.face = wp.array(np.full(shape, -1), dtype=wp.int32, device=self.device)
        self.residual = self._empty(wp.float64, (self.strands,))
        self.used, self.wake = (self._empty(wp.int32, (self.strands,)) for _ in range(2))
        self.points = self._empty(wp.vec3, shape[::-1])
        self.planes = self._empty(wp.vec4, shape[::-1])
        # a CPU runs its threads one after another: one scratch column stays in the cache
        self.stride = 0 if self.device.is_cpu else 1
        column = (self.vertices, self.strands if self.stride else 1)
        self.scratch = self._columns(banded_kernels.Scratch(), column)

    def attach_body(self, bind: np.ndarray, triangles: np.ndarray) -> None:
        """Measure the strands' distances at rest from (V, 3) bind points, canonical."""
        wp = self.wp
        self.body = wp.array(np.ascontiguousarray(bind, np.float32), dtype=wp.vec3, device=self.device)
        faces = wp.array(np.ascontiguousarray(triangles, np.int32).ravel(), dtype=wp.int32, device=self.device)
        self.mesh = wp.Mesh(points=self.body, indices=faces)
        self._pose(np.array([0, 0, 0, 1]), np.zeros(3))
        self._body_in_head, self.drift = np.asarray(bind, float), 0.0
        self._look(self.rest, 1)
        self._run(self.kernels.rest_margin, (self.rest, self.load.plane, self.widest, self.load.margin))

    def move_body(self, points: np.ndarray) -> None:
        """Set the body's points (V, 3) [m] in the head's frame: in the world, single precision would not find the nearest of them far
        from the origin.
        """
        # No vertex's distance to the body can have shrunk by more than this sum.
        self.drift += float(np.sqrt(np.square(points - self._body_in_head).sum(1).max()))
        self._body_in_head = points
        staged = self.wp.array(np.ascontiguousarray(points, np.float32), dtype=self.wp.vec3, device="cpu", copy=False)
        self.wp.copy(self.body, staged)
        self.mesh.refit()

    def blow(self, wind: np.ndarray) -> None:
        """Set the acceleration (3,) that is added to gravity from now on, in world axes [m/s^2], whatever the hair's weight."""
        self.wind = self.wp.vec3d(*(float(v) for v in wind))

    def begin(self, turn: np.ndarray, origin: np.ndarray, points: np.ndarray) -> None:
        """Set the first pose, the head's rotation (4,) xyzw and position (3,) [m], and (S, K, 3) canonical points [m]."""
        self._pose(turn, origin)
        self.x.assign(np.ascontiguousarray(np.swapaxes(points @ self._matrix().T + origin, 0, 1)))
        self.carry = self.carry_before = self.wp.quatd(0.0, 0.0, 0.0, 1.0), self.wp.vec3d(0.0, 0.0, 0.0)

    def settle(self, dts: Sequence[float], iterations: int) -> None:
        """Follow a gradient flow, in steps of `dts` [s], to the equilibrium of the pose, or until nothing moves."""
        for i, dt in enumerate(dts):
            self.wp.copy(self.last, self.x)
            self.used.zero_()
            if self.mesh is not None:
                self._look(self.x, int(i == 0))
            self._solve(dt, iterations, settling=1)
            if not self.used.numpy().any():
                break

    def start_moving(self, before: np.ndarray) -> None:
        """Give every vertex the velocity of a head that was at `before` one step ago."""
        shift = before - np.array(self.origin)
        self.before.assign(self.x.numpy() + shift)
        for velocity in (self.moved, self.moved_before):
            velocity.fill_(self.wp.vec3d(*(float(v) for v in -shift)))
        self._pose_before = self.turn, self.wp.vec3d(*(float(v) for v in before))
        self._moving = False

    def step(self, turn: np.ndarray, origin: np.ndarray, dt: float, iterations: int) -> None:
        """Advance by `dt` [s] to a new pose of the head, rotation (4,) xyzw and position (3,) [m], in at most `iterations`
        Newton steps; the body has already been moved.
        """
        wp = self.wp
        older, self._pose_before = self._pose_before, (self.turn, self.origin)
        self._pose(turn, origin)
        self.carry, self.carry_before = self._carry(*self._pose_before), self._carry(*older)
        if self._moving:
            self.before, self.last, self.x = self.last, self.x, self.before
        else:
            self.last, self.x = self.x, self.last
            self._moving = True
        if self.mesh is not None:
            # not at the predicted state, which may be past the body's far side
            self._run(self.kernels.carry_along, (*self.carry, self.last, self.x))
            self._look(self.x, 1)
        args = (self.turn, self.origin, self.rest, self.constants.length, self.last, self.before, self.x)
        wp.launch(self.kernels.predict, dim=self.strands, inputs=list(args), device=self.device)
        self.used.zero_()
        self._solve(dt, iterations, settling=0)
        self.moved, self.moved_before = self.moved_before, self.moved
        self._run(self.kernels.keep_velocity, (self.x, self.last, self.before, self.moved))

    def read(self, points: np.ndarray, planes: np.ndarray | None) -> tuple[float, float]:
        """Write (S, K, 3) and, if wanted, (S, K, 4) canonical; return residual and Newton steps as in `solver.SimulatedHair`."""
        args = (self.turn, self.origin, NEAR, self.x, self.load.plane, self.points, self.planes)
        self._run(self.kernels.to_canonical, args)
        points[:] = self.points.numpy()
        if planes is not None:
            planes[:] = self.planes.numpy()
        residual = np.sqrt(np.mean(self.residual.numpy() ** 2)) / G
        return float(residual), float(self.used.numpy().mean())

    def _solve(self, dt: float, iterations: int, settling: int) -> None:
        spent = 0
        for chunk in CHUNKS:
            take = min(chunk, iterations - spent)
            if take <= 0:
                break
            together = self.clumped or self.volume is not None
            if self.mesh is None and not together:
                take = iterations
            if spent > 0:
                self.wake.fill_(int(together))
                if self.mesh is not None:
                    self._look(self.x, 0)
            if spent == 0 or together:
                self._gather(1.0 / dt, settling)
            self._newton(take, int(spent > 0))
            spent += take

    def _gather(self, inverse_dt: float, settling: int) -> None:
        args = (
            self.constants.mass, self.rest, self.support, self.weight, self.damping, self.clumping, self.neighbours,
            self.turn, self.gravity, self.wind, *self.carry, *self.carry_before, inverse_dt, settling,
            self.x, self.last, self.before, self.moved, self.moved_before, self.load.target, self.load.pull,
        )  # fmt: skip
        self._run(self.kernels.forces, args)
        if self.volume is not None:
            self.volume.push(self.x, self.load.target, self.load.pull)

    def _newton(self, iterations: int, again: int) -> None:
        args = [
            self.constants, self.load, self.scratch, self.stride, self.x, self.tension, iterations, self.tolerance,
            again, self.wake, self.residual, self.used,
        ]  # fmt: skip
        self.wp.launch(self.rod_kernels.newton, dim=self.strands, inputs=args, device=self.device)

    def _look(self, x: object, moved: int) -> None:
        args = (
            self.mesh.id, REACH, moved, self.turn, self.origin, self.drift, x, self.seen, self.clear, self.face,
            self.corner, self.load.plane, self.wake,
        )  # fmt: skip
        self._run(self.kernels.body_planes, args)

    def _carry(self, turn: object, origin: object) -> tuple:
        """Rotation and origin of the motion that takes a point fixed to the head from a pose to the present one."""
        change = self.turn * self.wp.quat_inverse(turn)
        return change, self.origin - self.wp.quat_rotate(change, origin)

    def _matrix(self) -> np.ndarray:
        return np.array(self.wp.quat_to_matrix(self.turn), np.float64).reshape(3, 3)

    def _pose(self, turn: np.ndarray, origin: np.ndarray) -> None:
        self.turn = self.load.turn = self.wp.quatd(*(float(v) for v in turn))
        self.origin = self.wp.vec3d(*(float(v) for v in origin))

    def _run(self, kernel: object, args: tuple) -> None:
        self.wp.launch(kernel, dim=(self.vertices, self.strands), inputs=list(args), device=self.device)

    def _columns(self, scratch: object, shape: tuple) -> object:
        for name in ("now", "trial", "frame"):
            setattr(scratch, name, self._empty(self.wp.vec3d, shape))
        for name in ("step", "right"):
            setattr(scratch, name, self._empty(self.wp.vec4d, shape))
        for name in ("diagonal", "lower1", "lower2"):
            setattr(scratch, name, self._empty(self.wp.mat44d, shape))
        return scratch

    def _empty(self, dtype: object, shape: tuple) -> object:
        return self.wp.zeros(shape, dtype=dtype, device=self.device)

    def _vectors(self, values: np.ndarray) -> object:
        return self.wp.array(np.ascontiguousarray(np.swapaxes(values, 0, 1)), dtype=self.wp.vec3d, device=self.device)

    def _reals(self, values: np.ndarray) -> object:
        return self.wp.array(np.ascontiguousarray(values.T), dtype=self.wp.float64, device=self.device)
