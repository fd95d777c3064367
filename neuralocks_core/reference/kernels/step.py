# SPDX-License-Identifier: Apache-2.0
"""The parts of a time step besides the Newton solve: prediction, forces, neighbours, body contact. Arrays are (K, S)."""

import warp as wp

from neuralocks_core import materials
from neuralocks_core.reference.kernels.banded import array_real, array_vec

NO_PLANE = wp.constant(wp.vec4d(*materials.NO_PLANE))
NO_PLANE_SINGLE = wp.constant(wp.vec4(*materials.NO_PLANE))
STILL = wp.constant(wp.float64(5e-4))
FAR = wp.constant(wp.float64(0.02))
FAR_AHEAD = wp.constant(wp.float64(0.05))
"""[m] A vertex that moved less than STILL in a step keeps its plane; one farther from the body than FAR, or than
FAR_AHEAD before it moves, needs none."""


@wp.kernel(enable_backward=False)
def predict(
    turn: wp.quatd,
    origin: wp.vec3d,
    rest: array_vec,
    length: array_real,
    last: array_vec,
    before: array_vec,
    x: array_vec,
):
    """Clamp to the posed groom; past the clamp, edges keep turning as in the last step."""
    s = wp.tid()
    vertices = x.shape[0]
    x[0, s] = origin + wp.quat_rotate(turn, rest[0, s])
    here = origin + wp.quat_rotate(turn, rest[1, s])
    x[1, s] = here
    for k in range(2, vertices):
        now = last[k, s] - last[k - 1, s]
        edge = wp.float64(2.0) * now - (before[k, s] - before[k - 1, s])
        if wp.length(edge) < wp.float64(0.1) * length[k, s]:
            edge = now
        here = here + length[k, s] * wp.normalize(edge)
        x[k, s] = here


@wp.kernel(enable_backward=False)
def carry_along(carry: wp.quatd, origin: wp.vec3d, last: array_vec, x: array_vec):
    """The last state as the head carries it along: it stays next to the body as before, so on the correct side."""
    k, s = wp.tid()
    x[k, s] = wp.quat_rotate(carry, last[k, s]) + origin


@wp.kernel(enable_backward=False)
def forces(
    mass: array_real,
    rest: array_vec,
    support: array_vec,
    weight: wp.array(dtype=wp.float64),
    damping: wp.array(dtype=wp.float64),
    clumping: wp.array(dtype=wp.float64),
    neighbours: wp.array2d(dtype=wp.int32),
    turn: wp.quatd,
    gravity: wp.vec3d,
    wind: wp.vec3d,
    carry: wp.quatd,
    carry_origin: wp.vec3d,
    carry_before: wp.quatd,
    carry_before_origin: wp.vec3d,
    inverse_dt: wp.float64,
    settling: int,
    x: array_vec,
    last: array_vec,
    before: array_vec,
    moved: array_vec,
    moved_before: array_vec,
    target: array_vec,
    pull: array_real,
):
    """All quadratic terms in one spring per vertex: pull/2 |x - target|^2.

    Velocity and acceleration are the second backward differences of Choi and Ko (2002), over the last two positions, `last` and
    `before`, and the last two velocities, `moved` and `moved_before` [m per step]. carry and carry_before take a point fixed to
    the head from the last pose and from the one before it to this one: velocity is damped towards the head's. Neighbours are
    read in their current state (Jacobi). While settling there is neither velocity nor damping.
    """
    k, s = wp.tid()
    if k > 1:
        m = mass[k, s]
        old = last[k, s]
        stiff = inverse_dt * inverse_dt
        sum = stiff * old
        if settling == 0:
            three = wp.float64(3.0)
            four = wp.float64(4.0)
            half = wp.float64(0.5)
            older = before[k, s]
            # velocity is (3 x - flight) / 2 per step, and acceleration the same of velocities
            flight = four * old - older
            sum = half * stiff * (half * three * flight + four * moved[k, s] - moved_before[k, s])
            stiff = half * half * three * three * stiff
            drag = half * damping[s] * inverse_dt
            here = wp.quat_rotate(carry, old) + carry_origin
            sum = sum + drag * (four * here - wp.quat_rotate(carry_before, older) - carry_before_origin)
            stiff = stiff + three * drag
        sum = sum + weight[s] * gravity + wind
        count = wp.float64(0.0)
        meet = wp.vec3d()
        for j in range(neighbours.shape[0]):
            other = neighbours[j, s]
            if other >= 0:
                count += wp.float64(1.0)
                meet = meet + x[k, other] + wp.quat_rotate(turn, rest[k, s] - rest[k, other])
        if count > wp.float64(0.0):
            tie = wp.float64(2.0) * clumping[s]
            sum = sum + tie * meet / count
            stiff = stiff + tie
        force = m * sum + weight[s] * wp.quat_rotate(turn, support[k, s])
        pull[k, s] = m * stiff
        target[k, s] = force / (m * stiff)


@wp.kernel(enable_backward=False)
def keep_velocity(x: array_vec, last: array_vec, before: array_vec, moved: array_vec):
    """Velocity at the end of a step [m per step]: the second backward difference."""
    k, s = wp.tid()
    moved[k, s] = wp.float64(1.5) * (x[k, s] - last[k, s]) - wp.float64(0.5) * (last[k, s] - before[k, s])


@wp.kernel(enable_backward=False)
def body_planes(
    mesh: wp.uint64,
    reach: wp.float32,
    moved: int,
    turn: wp.quatd,
    origin: wp.vec3d,
    drift: wp.float64,
    x: array_vec,
    seen: array_vec,
    clear: array_real,
    face: wp.array2d(dtype=wp.int32),
    corner: wp.array2d(dtype=wp.vec2),
    plane: wp.array2d(dtype=wp.vec4d),
    wake: wp.array(dtype=wp.int32),
):
    """Nearest body element as a plane through its closest point; distances inside are negative. The mesh is in the head's frame.

    drift: the farthest that any point of the body has moved in the head's frame since the beginning, summed over steps. A vertex
    that cannot have come near the body since it was `seen` (head's frame, drift already added to `clear`) has no plane;
    one that hardly moved on a still body (`moved` 0) keeps its plane; else its strand is woken. The element
    found last, where it is now, bounds the search.
    """
    k, s = wp.tid()
    if k < 2:
        return
    home = wp.quat_rotate_inv(turn, x[k, s] - origin)
    shift = wp.length(home - seen[k, s])
    far = FAR
    if moved == 1:
        far = FAR_AHEAD
    if clear[k, s] - shift - drift > far:
        plane[k, s] = NO_PLANE
        return
    if moved == 0 and shift < STILL:
        return
    q = wp.vec3(wp.float32(home[0]), wp.float32(home[1]), wp.float32(home[2]))
    bound = reach
    last = face[k, s]
    if last >= 0:
        uv = corner[k, s]
        bound = wp.min(reach, wp.length(wp.mesh_eval_position(mesh, last, uv[0], uv[1]) - q) + 1.0e-5)
    hit = wp.mesh_query_point_sign_normal(mesh, q, bound, 1.0e-3)
    found = NO_PLANE
    free = wp.float64(reach)
    element = int(-1)  # noqa: UP018
    if hit.result:
        element = hit.face
        corner[k, s] = wp.vec2(hit.u, hit.v)
        near = wp.mesh_eval_position(mesh, hit.face, hit.u, hit.v)
        away = (q - near) * hit.sign
        gap = wp.length(away)
        free = wp.float64(gap * hit.sign)
        # on the surface itself the difference has no direction: use the face's normal
        n = wp.mesh_eval_face_normal(mesh, hit.face)
        if gap > 1.0e-4:
            n = away / gap
        normal = wp.quat_rotate(turn, wp.vec3d(wp.float64(n[0]), wp.float64(n[1]), wp.float64(n[2])))
        at = wp.quat_rotate(turn, wp.vec3d(wp.float64(near[0]), wp.float64(near[1]), wp.float64(near[2]))) + origin
        found = wp.vec4d(normal[0], normal[1], normal[2], wp.dot(normal, at))
    wake[s] = 1
    face[k, s] = element
    seen[k, s] = home
    clear[k, s] = free + drift
    plane[k, s] = found


@wp.kernel(enable_backward=False)
def rest_margin(x: array_vec, plane: wp.array2d(dtype=wp.vec4d), widest: wp.float64, margin: array_real):
    """Hair that rests closer to the body than the margin, or inside it, is not pushed out of its rest shape."""
    k, s = wp.tid()
    p = x[k, s]
    wall = plane[k, s]
    margin[k, s] = wp.min(widest, wall[0] * p[0] + wall[1] * p[1] + wall[2] * p[2] - wall[3])


@wp.kernel(enable_backward=False)
def to_canonical(
    turn: wp.quatd,
    origin: wp.vec3d,
    near: wp.float64,
    x: array_vec,
    plane: wp.array2d(dtype=wp.vec4d),
    points: wp.array2d(dtype=wp.vec3),
    planes: wp.array2d(dtype=wp.vec4),
):
    """Positions and body planes in the head's frame, (S, K) float32; planes farther than `near` are left out."""
    k, s = wp.tid()
    p = x[k, s]
    q = wp.quat_rotate_inv(turn, p - origin)
    points[s, k] = wp.vec3(wp.float32(q[0]), wp.float32(q[1]), wp.float32(q[2]))
    wall = plane[k, s]
    n = wp.vec3d(wall[0], wall[1], wall[2])
    if wp.dot(n, p) - wall[3] > near:
        planes[s, k] = NO_PLANE_SINGLE
    else:
        m = wp.quat_rotate_inv(turn, n)
        d = wall[3] - wp.dot(n, origin)
        planes[s, k] = wp.vec4(wp.float32(m[0]), wp.float32(m[1]), wp.float32(m[2]), wp.float32(d))
