# SPDX-License-Identifier: Apache-2.0
"""Newton's method on one inextensible strand per thread: warp kernels for CPU and CUDA from one source.

Unknowns are the vertices behind the clamp and, so that the band stays narrow, the twist of each edge's parallel
transported frame: a change of one edge turns all later frames (holonomy), which would make the Hessian dense.
With the twist as a fourth unknown, tied to the edges by a stiff row, the system is block-banded: 4x4 blocks, two to
each side, solved by a block Cholesky. Edges never change length: a step turns them.

All arrays are (K, S), vertex first, so that GPU threads read neighbouring memory. Scratch has one column per thread on
a GPU and a single one on a CPU, where threads run one after another and the column stays in the cache.
"""

import warp as wp

from neuralocks_core.reference.kernels.banded import (
    Scratch,
    add_row,
    array_real,
    array_vec,
    factor_and_solve,
    put,
    take,
)
from neuralocks_core.reference.kernels.energy import FOLD, MARGIN_LINEAR, Load, Rods, bend_scale, energy

RATE = wp.constant(wp.float64(1.0))
"""Largest rate at which a Newton step lets the bend vector turn with an edge; 1/2 on a straight strand."""
STRETCH = wp.constant(wp.float64(1e6))
"""Stiffness against stretch inside a Newton step [m^2/s^2]; the remaining stretch becomes the tension."""
ROUNDING = wp.constant(wp.float64(1e-15))
"""Bound on the relative error of double precision after the few operations between a coordinate and a bend."""
TWIST_TIE = wp.constant(wp.float64(1e3))
"""Stiffness of the row that ties the frames' twist to the edges, in units of the bend stiffness."""


@wp.func
def begin_with_load(rods: Rods, load: Load, scratch: Scratch, c: int, s: int):
    """Springs and body, one vertex each; overwrites gradient and blocks."""
    zero = wp.float64(0.0)
    two = wp.float64(2.0)
    vertices = scratch.now.shape[0]
    for k in range(2, vertices):
        p = scratch.now[k, c]
        weight = load.pull[k, s]
        g = weight * (p - load.target[k, s])
        block = wp.mat44d()
        wall = load.plane[k, s]
        depth = load.margin[k, s] - (wall[0] * p[0] + wall[1] * p[1] + wall[2] * p[2] - wall[3])
        if depth > zero:
            n = wp.vec3d(wall[0], wall[1], wall[2])
            capped = wp.min(depth, MARGIN_LINEAR)
            stiff = wp.float64(3.0) * load.collision * rods.mass[k, s]
            g = g - stiff * capped * capped * n
            n4 = put(n)
            block = wp.outer(two * stiff * capped * n4, n4)
        block[0, 0] = block[0, 0] + weight
        block[1, 1] = block[1, 1] + weight
        block[2, 2] = block[2, 2] + weight
        block[3, 3] = block[3, 3] + wp.float64(1e-12)
        scratch.diagonal[k, c] = block
        scratch.lower1[k, c] = wp.mat44d()
        scratch.lower2[k, c] = wp.mat44d()
        scratch.right[k, c] = -put(g)


@wp.func
def add_bend(rods: Rods, scratch: Scratch, c: int, s: int):
    """Bending, from the tip to the root; `moment` is the slope of the bends passed so far when all their frames twist together,
    as turning an edge before them does (holonomy)."""
    zero = wp.float64(0.0)
    one = wp.float64(1.0)
    two = wp.float64(2.0)
    half = wp.float64(0.5)
    vertices = scratch.now.shape[0]
    moment = zero
    j = vertices - 2
    while j >= 1:
        back = rods.length[j, s]
        ahead = rods.length[j + 1, s]
        e = (scratch.now[j, c] - scratch.now[j - 1, c]) / back
        f = (scratch.now[j + 1, c] - scratch.now[j, c]) / ahead
        sum = wp.max(one + wp.dot(e, f), FOLD)
        cross = wp.cross(e, f)
        slope = -one / (two * sum * wp.sqrt(two * sum))
        scale = bend_scale(one + wp.dot(e, f))
        bend = scale * cross
        rest = scratch.frame[j, c]
        a = rods.bend[j, s]
        force = -two * a * rest
        along = slope * wp.dot(force, cross)
        hol = -cross / sum
        ge = scale * wp.cross(f, force) + (along - half * a) * f + moment * hol
        gf = scale * wp.cross(force, e) + (along - half * a) * e + moment * hol
        ge = (ge - wp.dot(ge, e) * e) / back
        gf = (gf - wp.dot(gf, f) * f) / ahead
        moment += -two * a * wp.dot(bend, wp.cross(e, rest))
        scratch.right[j + 1, c] = scratch.right[j + 1, c] - put(gf)
        if j > 1:
            scratch.right[j, c] = scratch.right[j, c] - put(ge - gf)
        if j > 2:
            scratch.right[j - 1, c] = scratch.right[j - 1, c] + put(ge)

        u = wp.cross(e, wp.vec3d(one, zero, zero))
        if wp.abs(e[0]) > wp.float64(0.7):
            u = wp.cross(e, wp.vec3d(zero, one, zero))
        u = wp.normalize(u)
        # near a fold the bend's direction turns faster than any quadratic model can follow: cap its rate
        rate = wp.min(scale, RATE)
        fall = -rate * rate * rate
        for _turn in range(2):
            lean = fall * wp.dot(u, cross)
            ru = rate * wp.cross(f, u) + lean * f
            rv = rate * wp.cross(u, e) + lean * e
            ru = (ru - wp.dot(ru, e) * e) / back
            rv = (rv - wp.dot(rv, f) * f) / ahead
            add_row(scratch, c, j, ru, rv, -wp.dot(u, wp.cross(e, rest)), zero, two * a)
            u = wp.cross(e, u)
        hu = (hol - wp.dot(hol, e) * e) / back
        hv = (hol - wp.dot(hol, f) * f) / ahead
        add_row(scratch, c, j, -hu, -hv, -one, one, TWIST_TIE * a)
        j -= 1


@wp.func
def assemble(rods: Rods, load: Load, scratch: Scratch, c: int, s: int):
    """Exact negative gradient (holonomy included) in `right`, Gauss-Newton Hessian without tension in the blocks."""
    begin_with_load(rods, load, scratch, c, s)
    add_bend(rods, scratch, c, s)


@wp.func
def add_tension(rods: Rods, scratch: Scratch, tension: array_real, c: int, s: int):
    """Stretch stiffness, pull of the tension and its geometric stiffness; returns the squared force residual / mass."""
    zero = wp.float64(0.0)
    vertices = scratch.now.shape[0]
    for k in range(2, vertices):
        length = rods.length[k, s]
        e = (scratch.now[k, c] - scratch.now[k - 1, c]) / length
        t = tension[k, s]
        e4 = put(e)
        across = wp.max(t, zero) / length
        block = wp.outer((STRETCH / length - across) * e4, e4)
        block[0, 0] = block[0, 0] + across
        block[1, 1] = block[1, 1] + across
        block[2, 2] = block[2, 2] + across
        scratch.diagonal[k, c] = scratch.diagonal[k, c] + block
        scratch.right[k, c] = scratch.right[k, c] - t * e4
        if k > 2:
            scratch.diagonal[k - 1, c] = scratch.diagonal[k - 1, c] + block
            scratch.lower1[k, c] = scratch.lower1[k, c] - block
            scratch.right[k - 1, c] = scratch.right[k - 1, c] + t * e4
    total = zero
    for k in range(2, vertices):
        r = take(scratch.right[k, c]) / rods.mass[k, s]
        total += wp.dot(r, r)
    return total / wp.float64(vertices - 2)


@wp.func
def turn_edges(rods: Rods, scratch: Scratch, c: int, s: int, size: wp.float64):
    """Walk from the clamp along edges turned by `size` times the step; lengths stay exact."""
    vertices = scratch.now.shape[0]
    scratch.trial[0, c] = scratch.now[0, c]
    scratch.trial[1, c] = scratch.now[1, c]
    here = scratch.now[1, c]
    for k in range(2, vertices):
        length = rods.length[k, s]
        e = (scratch.now[k, c] - scratch.now[k - 1, c]) / length
        d = take(scratch.step[k, c]) / length
        if k > 2:
            d = d - take(scratch.step[k - 1, c]) / length
        d = d - wp.dot(d, e) * e
        here = here + length * wp.normalize(e + size * d)
        scratch.trial[k, c] = here


@wp.func
def blur(rods: Rods, x: array_vec, c: int, s: int):
    """Bound on what rounding alone changes in the energy of bending, in column c of x: the rounding of a coordinate turns an edge of
    length l by |x| / l as much. It is no share of the energy itself, which nearly vanishes in stiff short hair."""
    total = wp.float64(0.0)
    for i in range(1, x.shape[0] - 1):
        total += rods.bend[i, s] * (wp.float64(1.0) + wp.length(x[i, c]) / rods.length[i + 1, s])
    return ROUNDING * total


@wp.kernel(enable_backward=False)
def newton(
    rods: Rods,
    load: Load,
    scratch: Scratch,
    stride: int,
    x: array_vec,
    tension: array_real,
    iterations: int,
    tolerance: wp.float64,
    again: int,
    wake: wp.array(dtype=wp.int32),
    residual: wp.array(dtype=wp.float64),
    used: wp.array(dtype=wp.int32),
):
    """Improve each strand by at most `iterations` Newton steps with a backtracking line search on the true energy.

    residual: rms over the free vertices of the net force per mass [m/s^2], with tension solved for; a strand stops if it
    is below `tolerance`. again: not the step's first solve; strands solved before and not woken are skipped.
    """
    s = wp.tid()
    if again == 1 and wake[s] == 0 and residual[s] < tolerance:
        return
    c = s * stride
    vertices = x.shape[0]
    for k in range(vertices):
        scratch.now[k, c] = x[k, s]
    best = energy(rods, load, scratch.now, scratch.frame, c, s)
    same = blur(rods, scratch.now, c, s)
    left = wp.float64(0.0)
    go = bool(True)  # noqa: UP018 -- warp takes a plain literal for a constant
    n = int(0)  # noqa: UP018
    fails = int(0)  # noqa: UP018
    while go:
        assemble(rods, load, scratch, c, s)
        left = wp.sqrt(add_tension(rods, scratch, tension, c, s))
        if n >= iterations or left < tolerance:
            go = False
        else:
            factor_and_solve(scratch, c)
            size = wp.float64(1.0)
            search = bool(True)  # noqa: UP018
            while search:
                turn_edges(rods, scratch, c, s, size)
                value = energy(rods, load, scratch.trial, scratch.frame, c, s)
                # a converged strand still needs its tension, so what rounding cannot tell apart counts as better
                if value <= best + wp.float64(1e-13) * wp.abs(best) + same:
                    best = value
                    search = False
                else:
                    size = size * wp.float64(0.4)
                    if size < wp.float64(0.001):
                        search = False
                        size = wp.float64(0.0)
                        fails += 1
                        go = fails < 3
            for k in range(2, vertices):
                if size > wp.float64(0.0):
                    e = (scratch.now[k, c] - scratch.now[k - 1, c]) / rods.length[k, s]
                    d = take(scratch.step[k, c])
                    if k > 2:
                        d = d - take(scratch.step[k - 1, c])
                    tension[k, s] = tension[k, s] + size * STRETCH * wp.dot(d, e) / rods.length[k, s]
                else:
                    # tensions from another state may have misled the step
                    tension[k, s] = wp.float64(0.0)
            if size > wp.float64(0.0):
                for k in range(2, vertices):
                    scratch.now[k, c] = scratch.trial[k, c]
            else:
                best = energy(rods, load, scratch.now, scratch.frame, c, s)
            n += 1
    for k in range(2, vertices):
        x[k, s] = scratch.now[k, c]
    residual[s] = left
    used[s] = used[s] + n
