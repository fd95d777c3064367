# SPDX-License-Identifier: Apache-2.0
"""Rotations as 3x3 matrices, and from and to quaternions (w, x, y, z) and rotation vectors; directions and affine transforms."""

import numpy as np

from neuralocks_core.errors import NeuralocksError

NEARLY = 1e-4
"""How far the columns' products may be from a rotation's so that two Newton steps reach rounding."""
FLAT = 1e-9
"""A scale below this counts as zero: no rotation can be read."""


class Mirrored(NeuralocksError):
    """A transform has negative scale."""


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of length one; zero vectors stay zero."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def to_quaternion(matrices: np.ndarray) -> np.ndarray:
    """Unit quaternions (..., 4) wxyz, w >= 0, of rotation matrices (..., 3, 3)."""
    matrices = np.asarray(matrices, float)
    flat = scipy_rotation().from_matrix(matrices.reshape(-1, 3, 3)).as_quat(canonical=True, scalar_first=True)
    return flat.reshape(*matrices.shape[:-2], 4)


def from_quaternion(quaternions: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4) wxyz, which need not be of unit length."""
    quaternions = np.asarray(quaternions, float)
    flat = scipy_rotation().from_quat(quaternions.reshape(-1, 4), scalar_first=True).as_matrix()
    return flat.reshape(*quaternions.shape[:-1], 3, 3)


def quaternion_product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Unit quaternions (..., 4) wxyz of the rotation b followed by a, from quaternions (..., 4) of any length."""
    aw, av, bw, bv = a[..., :1], a[..., 1:], b[..., :1], b[..., 1:]
    scalar = aw * bw - np.sum(av * bv, axis=-1, keepdims=True)
    result = np.concatenate([scalar, aw * bv + bw * av + np.cross(av, bv)], axis=-1)
    return result / np.linalg.norm(result, axis=-1, keepdims=True)


def continuous(quaternions: np.ndarray) -> np.ndarray:
    """Quaternions (T, ..., 4) with signs that make each continue the one before. q and -q are one rotation, and linear blending
    between them would pass through zero.
    """
    flips = np.sum(quaternions[1:] * quaternions[:-1], axis=-1) < 0
    signs = np.where(np.cumsum(flips, axis=0) % 2 == 1, -1.0, 1.0)[..., None]
    return np.concatenate([quaternions[:1], quaternions[1:] * signs])


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles (...) [rad] of the turns from rotation matrices a (..., 3, 3) to b (..., 3, 3)."""
    return np.arccos(np.clip((np.einsum("...ij,...ij->...", a, b) - 1) / 2, -1, 1))


def to_vector(matrices: np.ndarray) -> np.ndarray:
    """Rotation vectors (..., 3) [rad] of rotation matrices (..., 3, 3)."""
    matrices = np.asarray(matrices, float)
    return scipy_rotation().from_matrix(matrices.reshape(-1, 3, 3)).as_rotvec().reshape(*matrices.shape[:-2], 3)


def from_vector(vectors: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3) [rad]."""
    vectors = np.asarray(vectors, float)
    return scipy_rotation().from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(*vectors.shape[:-1], 3, 3)


def between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Smallest rotation (..., 3, 3) that takes directions a (..., 3) to b (..., 3); opposite ones turn about any normal."""
    return from_quaternion(quaternion_between(a, b))


def quaternion_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The rotation `between` two directions as quaternions (..., 4) wxyz, not of unit length."""
    a = np.asarray(a, float) / np.linalg.norm(a, axis=-1, keepdims=True)
    b = np.asarray(b, float) / np.linalg.norm(b, axis=-1, keepdims=True)
    a, b = np.broadcast_arrays(a, b)
    cosine = np.sum(a * b, axis=-1, keepdims=True)
    axis = np.cross(a, b)
    # At 180 degrees the cross product vanishes; any axis perpendicular to a will do.
    fallback = np.cross(a, np.where(np.abs(a[..., :1]) < 0.6, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    quaternion = np.concatenate([1 + cosine, axis], axis=-1)
    opposite = cosine < -1 + 1e-12
    return np.where(opposite, np.concatenate([0 * cosine, fallback], axis=-1), quaternion)


def sizes(transforms: np.ndarray) -> np.ndarray:
    """Signed sizes (...) of transforms (..., 4, 4): edge of a cube as large as the transformed unit cube, negative if mirrored."""
    return np.cbrt(volumes(np.asarray(transforms, float)[..., :3, :3]))


def sizes_shown(posed: np.ndarray, bind: np.ndarray) -> np.ndarray:
    """Signed scales (n,) of what a joint carries in some samples of an animation; 1 is the size in the bind pose.

    A character is measured, and the network reads its hair, at their median: a rig may draw its head twice as large as in the
    bind pose, and hair twice as long moves differently.

    Args:
        posed: (T, 4, 4) transforms of the joint; bind: (4, 4) in the bind pose.
    """
    few = np.unique(np.linspace(0, len(posed) - 1, 16).astype(int))
    return sizes(posed[few] @ np.linalg.inv(bind))


def volumes(linear: np.ndarray) -> np.ndarray:
    """Determinants (...) of matrices (..., 3, 3), written out: an LU decomposition of each takes four times as long."""
    (a, b, c), (d, e, f), (g, h, i) = np.moveaxis(np.asarray(linear, float), (-2, -1), (0, 1))
    return a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g)


def flat(linear: np.ndarray, least: float = FLAT) -> np.ndarray:
    """Which matrices (..., 3, 3) scale an axis by less than `least`, as joints that hide what they move do, (...) bool."""
    return np.linalg.norm(linear, axis=-2).min(axis=-1) < least


def transformed(points: np.ndarray, transform: np.ndarray) -> np.ndarray:
    """Points (..., 3) through an affine transform (4, 4), in float64."""
    return np.asarray(points, float) @ transform[:3, :3].T + transform[:3, 3]


def strayed(path: np.ndarray, carrier: np.ndarray) -> float:
    """The largest distance of a path (T, 3) from where its first point would go with a carrier, transforms (T, 4, 4); infinite if that
    is flat at first.
    """
    if flat(carrier[0, :3, :3]):
        return np.inf
    first = transformed(path[0], np.linalg.inv(carrier[0]))
    return float(np.linalg.norm(path - (carrier[:, :3, :3] @ first + carrier[:, :3, 3]), axis=-1).max())


def inverse(transform: np.ndarray) -> np.ndarray:
    """Inverse (4, 4) of one affine transform (4, 4), written out.

    In Blender 4, numpy's own wakes a thread that then spins on a core needed for computing hair; and its last bits differ
    between versions of numpy.

    Raises:
        NeuralocksError: the transform is flat or not finite.
    """
    (a, b, c, x), (d, e, f, y), (g, h, i, z) = np.asarray(transform, float)[:3].tolist()
    p, q, r = e * i - f * h, f * g - d * i, d * h - e * g
    volume = a * p + b * q + c * r
    if not 0 < abs(volume) < np.inf:
        raise NeuralocksError("transform: flat or not finite; give every object and joint a scale above zero")
    linear = np.array(
        [[p, c * h - b * i, b * f - c * e], [q, a * i - c * g, c * d - a * f], [r, b * g - a * h, a * e - b * d]]
    )
    result = np.eye(4)
    result[:3, :3] = linear / volume
    result[:3, 3] = -result[:3, :3] @ (x, y, z)
    return result


def inverses(transforms: np.ndarray) -> np.ndarray:
    """Inverses (..., 4, 4) of affine transforms (..., 4, 4) that are not flat, written out for the same reasons as `inverse`."""
    linear = transforms[..., :3, :3]
    a, b, c = (linear[..., column] for column in range(3))
    result = np.zeros_like(transforms)
    result[..., :3, :3] = np.stack([cross(b, c), cross(c, a), cross(a, b)], axis=-2) / volumes(linear)[..., None, None]
    result[..., :3, 3:] = -result[..., :3, :3] @ transforms[..., :3, 3:]
    result[..., 3, 3] = 1
    return result


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products (..., 3) of vectors (..., 3), written out so that no version of numpy changes their last bits."""
    (ax, ay, az), (bx, by, bz) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def relative_to_parents(world: np.ndarray, parents: np.ndarray) -> np.ndarray:
    """Transforms of joints (..., J, 4, 4) relative to their parents (J,), -1 for a root, from world transforms."""
    local, below = world.copy(), parents >= 0
    local[..., below, :, :] = np.linalg.inv(world[..., parents[below], :, :]) @ world[..., below, :, :]
    return local


def from_parents(local: np.ndarray, parents: np.ndarray) -> np.ndarray:
    """Transforms of joints (..., J, 4, 4) in their skeleton's space from those relative to their parents (J,), which come first: the
    inverse of `relative_to_parents`.
    """
    world = local.copy()
    for joint, parent in enumerate(parents):
        if parent >= 0:
            world[..., joint, :, :] = world[..., parent, :, :] @ world[..., joint, :, :]
    return world


def rotation_part(transforms: np.ndarray, subject: str = "transform") -> np.ndarray:
    """Rotation (..., 3, 3) of transforms (..., 4, 4), with scale divided out.

    Raises:
        Mirrored: a transform is mirrored.
        NeuralocksError: a transform is flat or not finite; `subject` names it.
    """
    linear = np.asarray(transforms, float)[..., :3, :3]
    if not np.isfinite(linear).all():
        raise NeuralocksError(f"{subject}: a transform holds NaN or infinity; repair the animation")
    scale = np.linalg.norm(linear, axis=-2, keepdims=True)
    if scale.size and scale.min() < FLAT:
        raise NeuralocksError(f"{subject}: a transform has zero scale; give every joint a scale above zero")
    linear = linear / scale
    if (volumes(linear) <= 0).any():
        raise Mirrored(f"{subject}: a transform is mirrored (negative scale); apply or remove the negative scale")
    # The nearest rotation, so that shear from non-uniform scale cannot leak in. Matrices that are rotations up to rounding are
    # refined by Newton's iteration, whose error is squared in each step: a fifth of the time.
    square = np.swapaxes(linear, -1, -2) @ linear
    if np.abs(square - np.eye(3)).max(initial=0.0) < NEARLY:
        once = 1.5 * linear - 0.5 * linear @ square
        return 1.5 * once - 0.5 * once @ (np.swapaxes(once, -1, -2) @ once)
    u, _, vt = np.linalg.svd(linear)
    return u @ vt


def polar(linear: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Matrices (..., 3, 3) as the nearest rotation times a stretch, both (..., 3, 3). The stretch of a mirrored one is negative. A
    flat one has a rotation, too: a joint may be scaled to zero to hide what it carries.
    """
    u, _, vt = np.linalg.svd(linear)
    turns = u @ vt
    turns *= np.where(volumes(turns) < 0, -1.0, 1.0)[..., None, None]
    return turns, np.swapaxes(turns, -1, -2) @ linear


def scipy_rotation() -> type:
    """SciPy's rotations, imported on use: they take longer to import than everything else that running a network needs."""
    from scipy.spatial.transform import Rotation

    return Rotation
