# SPDX-License-Identifier: Apache-2.0
"""Extended position based dynamics of one strand per thread, in the small-step form: float32, as games run it.

Macklin, Mueller, Chentanez 2016 (XPBD) with a single iteration per substep as in Macklin et al. 2019: Gauss-Seidel from
root to tip over distances (rigid), bends (compliance 1 / stiffness) and body planes. Arrays are (K, S).
"""

import warp as wp

from neuralocks_core import materials

array_vec = wp.array2d(dtype=wp.vec3)
array_real = wp.array2d(dtype=wp.float32)

NO_PLANE = wp.constant(wp.vec4(*materials.NO_PLANE))
CAUTION = wp.constant(1.5)
"""How much a bend's correction is reduced, as a factor on its vertices' inverse mass: with 1, a single pass whose
corrections reach back to the root shakes short stiff curls at rest. It vanishes in the compliance as substeps get short."""


@wp.func
def hold_length(x: array_vec, inverse_mass: array_real, length: float, k: int, s: int):
    """Bring the edge that ends in vertex k back to its length."""
    above = inverse_mass[k - 1, s]
    below = inverse_mass[k, s]
    d = x[k, s] - x[k - 1, s]
    size = wp.max(wp.length(d), 1.0e-9)
    move = (size - length) / (size * (above + below)) * d
    x[k - 1, s] = x[k - 1, s] + above * move
    x[k, s] = x[k, s] - below * move


@wp.func
def carry_frame(x: array_vec, twist: array_vec, q: wp.quat, along: wp.vec3, spin: float, i: int, s: int):
    """Frame and direction of the edge that ends in vertex i; sets `twist` [1/m] to how the frame turns as vertices move.

    q: frame of the edge before, built when that edge pointed `along`; spin: how far it has turned about the edge since.
    """
    d = x[i - 1, s] - x[i - 2, s]
    f = x[i, s] - x[i - 1, s]
    back = wp.max(wp.length(d), 1.0e-9)
    ahead = wp.max(wp.length(f), 1.0e-9)
    e = d / back
    f = f / ahead
    since = 0.5 * (wp.cross(along, e) + spin * e)
    cross = wp.cross(e, f)
    open = wp.max(1.0 + wp.dot(e, f), 1.0e-4)
    bend = cross / wp.sqrt(2.0 * open)
    hol = -cross / wp.max(open, 0.05)
    twist[i - 2, s] = twist[i - 2, s] - hol / back
    twist[i - 1, s] = twist[i - 1, s] + hol / back - hol / ahead
    twist[i, s] = hol / ahead
    turn = wp.quat(bend[0], bend[1], bend[2], wp.sqrt(0.5 * open)) * wp.quat(since[0], since[1], since[2], 1.0)
    return wp.normalize(turn * q), f


@wp.func
def hold_bend(
    x: array_vec,
    inverse_mass: array_real,
    twist: array_vec,
    waiting: array_real,
    settled: float,
    rest: wp.vec3,
    compliance: float,
    i: int,
    s: int,
):
    """Two constraints, u . (bend - rest) = 0 for the directions u across edge i; see `rod.add_bend`.

    Returns how far the edge's frame has turned. The first u is where `rest` moves when the frame turns. Corrections for vertices
    before i - 1, which this pass does not read again, wait in `waiting`; settled: their |twist|^2 / mass.
    """
    d = x[i, s] - x[i - 1, s]
    f = x[i + 1, s] - x[i, s]
    back = wp.max(wp.length(d), 1.0e-9)
    ahead = wp.max(wp.length(f), 1.0e-9)
    e = d / back
    f = f / ahead
    open = wp.max(1.0 + wp.dot(e, f), 0.05)
    scale = 1.0 / wp.sqrt(2.0 * open)
    cross = wp.cross(e, f)
    u = wp.cross(e, rest)
    lever = wp.length(u)
    if lever < 1.0e-5:
        lever = 0.0
        u = wp.cross(e, wp.vec3(1.0, 0.0, 0.0))
        if wp.abs(e[0]) > 0.7:
            u = wp.cross(e, wp.vec3(0.0, 1.0, 0.0))
    u = wp.normalize(u)
    w0 = inverse_mass[i - 1, s]
    w1 = inverse_mass[i, s]
    w2 = inverse_mass[i + 1, s]
    t0 = twist[i - 1, s]
    t1 = twist[i, s]
    spin = float(0.0)  # noqa: UP018 -- warp takes a plain literal for a constant
    for _turn in range(2):
        gap = scale * wp.dot(u, cross) - wp.dot(u, rest)
        lean = -scale * scale * scale * wp.dot(u, cross)
        a = scale * wp.cross(f, u) + lean * f
        b = scale * wp.cross(u, e) + lean * e
        a = (a - wp.dot(a, e) * e) / back
        b = (b - wp.dot(b, f) * f) / ahead
        m = a - b - lever * t1
        a = a + lever * t0
        far = lever * settled
        weight = w0 * wp.dot(a, a) + w1 * wp.dot(m, m) + w2 * wp.dot(b, b) + lever * far
        push = -gap / (CAUTION * weight + compliance)
        x[i - 1, s] = x[i - 1, s] - w0 * push * a
        x[i, s] = x[i, s] + w1 * push * m
        x[i + 1, s] = x[i + 1, s] + w2 * push * b
        spin += push * (w1 * wp.dot(t1, m) - w0 * wp.dot(t0, a) - far)
        if lever > 0.0:
            waiting[i, s] = -lever * push
        # the other direction is that of `rest`, which no turn changes
        lever = 0.0
        u = wp.cross(e, u)
    return spin


@wp.kernel(enable_backward=False)
def frame(
    length: array_real,
    inverse_mass: array_real,
    stiffness: array_real,
    curl: array_vec,
    rest: array_vec,
    push: array_vec,
    weight: wp.array(dtype=wp.float32),
    damping: wp.array(dtype=wp.float32),
    turns: wp.array(dtype=wp.quat),
    moves: wp.array(dtype=wp.vec3),
    gravity: wp.vec3,
    wind: wp.vec3,
    h: float,
    plane: wp.array2d(dtype=wp.vec4),
    margin: array_real,
    x: array_vec,
    old: array_vec,
    velocity: array_vec,
    twist: array_vec,
    waiting: array_real,
):
    """All substeps of a frame. turns: the head's rotation at each substep, the frame's start first.

    x: relative to the head's position at that moment, in world axes, since float32 is too coarse far from the origin.
    moves: how far that position moved in each substep; the first is not read. plane: in the head's frame. push: rest support
    per mass, head axes. stiffness: 4 B / l per interior vertex. twist, waiting: scratch of `carry_frame` and `hold_bend`.
    """
    s = wp.tid()
    vertices = x.shape[0]
    for step in range(1, turns.shape[0]):
        turn = turns[step]
        move = moves[step]
        carry = turn * wp.quat_inverse(turns[step - 1])
        keep = wp.exp(-damping[s] * h)
        for k in range(vertices):
            p = x[k, s]
            old[k, s] = p - move
            if k < 2:
                x[k, s] = wp.quat_rotate(turn, rest[k, s])
            else:
                along = (wp.quat_rotate(carry, p) - p + move) / h
                v = along + keep * (velocity[k, s] - along)
                v = v + h * (wind + weight[s] * (gravity + wp.quat_rotate(turn, push[k, s])))
                x[k, s] = old[k, s] + h * v
        q = turn
        edge = wp.normalize(x[1, s] - x[0, s])
        spin = float(0.0)  # noqa: UP018 -- warp takes a plain literal for a constant
        settled = float(0.0)  # noqa: UP018
        twist[0, s] = wp.vec3()
        twist[1, s] = wp.vec3()
        for k in range(2, vertices):
            i = k - 1
            hold_length(x, inverse_mass, length[k, s], k, s)
            if i > 1:
                q, edge = carry_frame(x, twist, q, edge, spin, i, s)
                settled += inverse_mass[i - 2, s] * wp.dot(twist[i - 2, s], twist[i - 2, s])
            rest_bend = wp.quat_rotate(q, curl[i, s])
            compliance = 1.0 / (stiffness[i, s] * h * h)
            waiting[i, s] = 0.0
            spin = hold_bend(x, inverse_mass, twist, waiting, settled, rest_bend, compliance, i, s)
        sum = float(0.0)  # noqa: UP018
        for passed in range(2, vertices):
            k = vertices + 1 - passed
            if k < vertices - 3:
                sum += waiting[k + 2, s]
            x[k, s] = x[k, s] + sum * inverse_mass[k, s] * twist[k, s]
            wall = plane[k, s]
            n = wp.vec3(wall[0], wall[1], wall[2])
            p = wp.quat_rotate_inv(turn, x[k, s])
            depth = margin[k, s] - (wp.dot(n, p) - wall[3])
            if depth > 0.0:
                x[k, s] = x[k, s] + depth * wp.quat_rotate(turn, n)
            velocity[k, s] = (x[k, s] - old[k, s]) / h


@wp.kernel(enable_backward=False)
def look(
    mesh: wp.uint64,
    reach: float,
    turn: wp.quat,
    carry: wp.quat,
    x: array_vec,
    plane: wp.array2d(dtype=wp.vec4),
):
    """Nearest body element of each vertex, turned with the head; a plane in the head's frame.

    Mesh and x: relative to the head's position.
    """
    k, s = wp.tid()
    q = wp.quat_rotate(carry, x[k, s])
    hit = wp.mesh_query_point_sign_normal(mesh, q, reach, 1.0e-3)
    found = NO_PLANE
    if hit.result:
        near = wp.mesh_eval_position(mesh, hit.face, hit.u, hit.v)
        away = (q - near) * hit.sign
        gap = wp.length(away)
        n = wp.mesh_eval_face_normal(mesh, hit.face)
        if gap > 1.0e-4:
            n = away / gap
        m = wp.quat_rotate_inv(turn, n)
        found = wp.vec4(m[0], m[1], m[2], wp.dot(n, near))
    plane[k, s] = found
