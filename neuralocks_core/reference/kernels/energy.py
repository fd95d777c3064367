# SPDX-License-Identifier: Apache-2.0
"""The energy of one inextensible strand as warp functions: bending relative to its rest curl, a pull, and the body."""

import warp as wp

from neuralocks_core.materials import LINEAR
from neuralocks_core.reference.kernels.banded import array_real, array_vec

FOLD = wp.constant(wp.float64(0.02))
"""1 + cos of the angle between two edges below which (168 degrees) the bend's direction fades out. The direction of an
exact fold is undefined, and a strand that swings through one would meet a discontinuity of the energy."""
MARGIN_LINEAR = wp.constant(wp.float64(LINEAR))


@wp.struct
class Rods:
    """Constants: see `rest.RestRods`; bend is 2B / Voronoi length [m^3/s^2] per interior vertex."""

    length: array_real
    mass: array_real
    curl: array_vec
    bend: array_real


@wp.struct
class Load:
    """What acts on the strands in one step besides their own bending: springs and the body. Arrays are (K, S).

    turn is the head's rotation; a spring of stiffness `pull` [1/s^2 times mass] draws each vertex to `target`; vertices nearer
    than `margin` to the body's `plane`, (normal, offset) in the world, are pushed off with stiffness `collision`.
    """

    turn: wp.quatd
    target: array_vec
    pull: array_real
    plane: wp.array2d(dtype=wp.vec4d)
    margin: array_real
    collision: wp.float64


@wp.func
def collision_energy(depth: wp.float64, stiffness: wp.float64):
    """Cubic, linear beyond MARGIN_LINEAR; per unit mass."""
    p = wp.clamp(depth, wp.float64(0.0), MARGIN_LINEAR)
    rest = wp.max(depth - MARGIN_LINEAR, wp.float64(0.0))
    return stiffness * (p * p * p + wp.float64(3.0) * MARGIN_LINEAR * MARGIN_LINEAR * rest)


@wp.func
def bend_scale(open: wp.float64):
    """1 / sqrt(2 (1 + cos)), which makes the cross product of two edges sin(theta/2) long; continued linearly below FOLD."""
    limit = wp.max(open, FOLD)
    scale = wp.float64(1.0) / wp.sqrt(wp.float64(2.0) * limit)
    return scale - scale * scale * scale * (open - limit)


@wp.func
def energy(
    rods: Rods,
    load: Load,
    x: array_vec,
    frame: array_vec,
    c: int,
    s: int,
):
    """Energy of strand s, in column c of x; writes the transported rest bend vectors to that of `frame`."""
    half = wp.float64(0.5)
    one = wp.float64(1.0)
    vertices = x.shape[0]
    q = load.turn
    total = wp.float64(0.0)
    e = wp.normalize(x[1, c] - x[0, c])
    for i in range(1, vertices):
        p = x[i, c]
        if i > 1:
            gap = p - load.target[i, s]
            total += half * load.pull[i, s] * wp.dot(gap, gap)
            wall = load.plane[i, s]
            depth = load.margin[i, s] - (wall[0] * p[0] + wall[1] * p[1] + wall[2] * p[2] - wall[3])
            if depth > wp.float64(0.0):
                total += rods.mass[i, s] * collision_energy(depth, load.collision)
        if i < vertices - 1:
            after = (x[i + 1, c] - p) / rods.length[i + 1, s]
            open = one + wp.dot(e, after)
            bend = bend_scale(open) * wp.cross(e, after)
            rest = wp.quat_rotate(q, rods.curl[i, s])
            frame[i, c] = rest
            # |bend - rest|^2, with |bend|^2 = sin^2(theta/2) in the form that is smooth up to the fold
            square = half * (one - wp.dot(e, after)) + wp.dot(rest, rest) - wp.float64(2.0) * wp.dot(bend, rest)
            total += rods.bend[i, s] * square
            q = wp.normalize(wp.quatd(bend[0], bend[1], bend[2], wp.sqrt(half * wp.max(open, FOLD))) * q)
            e = after
    return total
