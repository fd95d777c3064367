# SPDX-License-Identifier: Apache-2.0
"""A block-banded linear system per thread: 4x4 blocks, two to each side of the diagonal, vertices 0 and 1 held."""

import warp as wp

array_vec = wp.array2d(dtype=wp.vec3d)
array_real = wp.array2d(dtype=wp.float64)


@wp.struct
class Scratch:
    """Work space of one strand."""

    now: array_vec
    trial: array_vec
    frame: array_vec
    step: wp.array2d(dtype=wp.vec4d)
    right: wp.array2d(dtype=wp.vec4d)
    diagonal: wp.array2d(dtype=wp.mat44d)
    lower1: wp.array2d(dtype=wp.mat44d)
    lower2: wp.array2d(dtype=wp.mat44d)


@wp.func
def add_row(
    scratch: Scratch,
    c: int,
    i: int,
    before: wp.vec3d,
    after: wp.vec3d,
    twist: wp.float64,
    next: wp.float64,
    w: wp.float64,
):
    """Add w times the outer product of a row with itself, over (edge i, edge i+1, twist i, twist i+1) to the Hessian."""
    zero = wp.float64(0.0)
    a = wp.vec4d(-before[0], -before[1], -before[2], zero)
    m = before - after
    b = wp.vec4d(m[0], m[1], m[2], twist)
    d = wp.vec4d(after[0], after[1], after[2], next)
    scratch.diagonal[i + 1, c] = scratch.diagonal[i + 1, c] + wp.outer(w * d, d)
    if i > 1:
        scratch.diagonal[i, c] = scratch.diagonal[i, c] + wp.outer(w * b, b)
        scratch.lower1[i + 1, c] = scratch.lower1[i + 1, c] + wp.outer(w * d, b)
    if i > 2:
        scratch.diagonal[i - 1, c] = scratch.diagonal[i - 1, c] + wp.outer(w * a, a)
        scratch.lower1[i, c] = scratch.lower1[i, c] + wp.outer(w * b, a)
        scratch.lower2[i + 1, c] = scratch.lower2[i + 1, c] + wp.outer(w * d, a)


@wp.func
def put(v: wp.vec3d):
    return wp.vec4d(v[0], v[1], v[2], wp.float64(0.0))


@wp.func
def take(v: wp.vec4d):
    return wp.vec3d(v[0], v[1], v[2])


@wp.func
def inverse_factor(a: wp.mat44d):
    """Inverse G of the Cholesky factor of a: G a G^T = 1. An inverse of `a` itself would lose all precision here."""
    one = wp.float64(1.0)
    zero = wp.float64(0.0)
    tiny = wp.float64(1e-30)
    g00 = one / wp.sqrt(wp.max(a[0, 0], tiny))
    c10 = a[1, 0] * g00
    c20 = a[2, 0] * g00
    c30 = a[3, 0] * g00
    g11 = one / wp.sqrt(wp.max(a[1, 1] - c10 * c10, tiny))
    c21 = (a[2, 1] - c20 * c10) * g11
    c31 = (a[3, 1] - c30 * c10) * g11
    g22 = one / wp.sqrt(wp.max(a[2, 2] - c20 * c20 - c21 * c21, tiny))
    c32 = (a[3, 2] - c30 * c20 - c31 * c21) * g22
    g33 = one / wp.sqrt(wp.max(a[3, 3] - c30 * c30 - c31 * c31 - c32 * c32, tiny))
    g10 = -g11 * c10 * g00
    g21 = -g22 * c21 * g11
    g32 = -g33 * c32 * g22
    g20 = -g22 * (c20 * g00 + c21 * g10)
    g31 = -g33 * (c31 * g11 + c32 * g21)
    g30 = -g33 * (c30 * g00 + c31 * g10 + c32 * g20)
    return wp.mat44d(
        g00, zero, zero, zero, g10, g11, zero, zero, g20, g21, g22, zero, g30, g31, g32, g33
    )  # fmt: skip


@wp.func
def factor_and_solve(scratch: Scratch, c: int):
    """Block Cholesky of the banded system; the solution is left in `step`.

    diagonal becomes the inverse factor, lower1 and lower2 the factor's blocks.
    """
    vertices = scratch.now.shape[0]
    for k in range(2, vertices):
        d = scratch.diagonal[k, c]
        y = scratch.right[k, c]
        if k > 3:
            l2 = scratch.lower2[k, c] * wp.transpose(scratch.diagonal[k - 2, c])
            d = d - l2 * wp.transpose(l2)
            y = y - l2 * scratch.right[k - 2, c]
            scratch.lower2[k, c] = l2
            scratch.lower1[k, c] = scratch.lower1[k, c] - l2 * wp.transpose(scratch.lower1[k - 1, c])
        if k > 2:
            l1 = scratch.lower1[k, c] * wp.transpose(scratch.diagonal[k - 1, c])
            d = d - l1 * wp.transpose(l1)
            y = y - l1 * scratch.right[k - 1, c]
            scratch.lower1[k, c] = l1
        g = inverse_factor(d)
        scratch.diagonal[k, c] = g
        scratch.right[k, c] = g * y
    k = vertices - 1
    while k >= 2:
        z = scratch.right[k, c]
        if k + 1 < vertices:
            z = z - wp.transpose(scratch.lower1[k + 1, c]) * scratch.step[k + 1, c]
        if k + 2 < vertices:
            z = z - wp.transpose(scratch.lower2[k + 2, c]) * scratch.step[k + 2, c]
        scratch.step[k, c] = wp.transpose(scratch.diagonal[k, c]) * z
        k -= 1
