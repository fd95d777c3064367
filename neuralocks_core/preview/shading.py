# SPDX-License-Identifier: Apache-2.0
"""Colours for hair and body in a preview: light along the tangent, and shadow by the amount of hair in front."""

import numpy as np

ROOT, TIP, GLOSS = np.array([(0.040, 0.016, 0.008), (0.170, 0.068, 0.027), (0.62, 0.50, 0.40)])
"""Colours of hair, linear RGB: at the root, at the tip, of its highlights."""
SKIN, CLOTH = np.array([(0.56, 0.40, 0.33), (0.055, 0.075, 0.10)])
"""Colours of the body, linear RGB."""
KEY = np.array([0.55, 0.75, 0.65]) / np.linalg.norm([0.55, 0.75, 0.65])
FILL = np.array([-0.8, 0.25, 0.6]) / np.linalg.norm([-0.8, 0.25, 0.6])
RIM = np.array([-0.35, 0.55, -0.9]) / np.linalg.norm([-0.35, 0.55, -0.9])
CELL = 0.006
"""Width of a cell of the shadow map [m]."""
MOST_CELLS = 120
"""Most cells along each side of the shadow map."""
MOST_DEPTH = 3.0
"""Greatest optical depth of a cell of the shadow map. In tied hair it would be many times as much, so that no light reached the
middle of a cell that lies at the surface."""
COVER = 2.2
"""Width of all strands side by side [m]: determines how much light is dimmed, for any number of drawn strands."""


def hair_colours(
    hair: np.ndarray, to_eye: np.ndarray, centre: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, "ShadowMap"]:
    """Linear colours (S, N, 3) of strand vertices, and the shadow that the hair casts.

    Diffuse light and two highlights along the tangent (Kajiya and Kay 1989; the second one shifted and tinted as in
    Marschner et al. 2003), dimmed by the hair in front.

    Args:
        hair: strands (S, N, 3) [m], world.
        to_eye: unit vector towards the camera (3,).
        centre: middle of the head (3,) [m].
        axes: light axes, columns right, up, front (3, 3).
    """
    (strands, vertices, _), points = hair.shape, hair.reshape(-1, 3)
    x = (hair - centre).astype(np.float32)
    tangent = _unit(np.gradient(x, axis=1))
    outward = x.copy()
    outward -= np.einsum("snc,snc->sn", outward, tangent)[..., None] * tangent
    outward = _unit(outward)
    step = np.diff(x, axis=1)
    length = np.sqrt(np.einsum("snc,snc->sn", step, step)).mean(axis=1)
    shadow = ShadowMap(points, np.repeat(length * COVER / strands, vertices))

    rng = np.random.default_rng(7)
    down = np.linspace(0, 1, vertices)[None, :, None] ** 1.3
    base = (ROOT * (1 - down) + TIP * down).astype(np.float32)
    shift = rng.normal(0, 0.05, (strands, 1)).astype(np.float32)
    gloss = 0.5 * GLOSS.astype(np.float32)
    light = np.zeros(x.shape, np.float32)
    for direction, power, dim in ((KEY, 2.6, 1.0), (FILL, 0.55, 0.6), (RIM, 2.2, 1.0)):
        towards = (axes @ direction).astype(np.float32)
        clear = _smoothed(np.exp(-dim * shadow.depth(points, towards)).reshape(strands, vertices, 1))
        cosine = (tangent @ towards)[..., None]
        wrap = np.clip(0.55 + 0.45 * (outward @ towards)[..., None], 0, 1)
        diffuse = np.sqrt(np.clip(1 - cosine**2, 0, 1)) * wrap
        half = towards + to_eye
        half = (half / np.linalg.norm(half)).astype(np.float32)
        along, across = tangent @ half, outward @ half
        bright = 0.30 * _highlight(along, across, shift - 0.10, 90)[..., None]
        tinted = 0.9 * _highlight(along, across, shift + 0.14, 22)[..., None]
        light += power * clear * (base * (diffuse + tinted) + wrap * bright * gloss)
    sky = np.exp(-0.5 * shadow.depth(points, axes @ np.array([0, 0.8, 0.6]))).reshape(strands, vertices, 1)
    light += 0.30 * _smoothed(sky) * base
    return light, shadow


def body_colours(
    points: np.ndarray, normals: np.ndarray, albedo: np.ndarray, shadow: "ShadowMap | None", to_eye, axes: np.ndarray
) -> np.ndarray:
    """sRGB colours (V, 3) float32 of skin: soft light from three sides, dimmed by the hair in front.

    Args:
        points: (V, 3) [m].
        normals: outward unit normals (V, 3).
        albedo: linear RGB (V, 3).
        shadow: of the hair.
        to_eye: unit vector towards the camera (3,).
        axes: light axes as in `hair_colours`.
    """
    light = np.zeros_like(points)
    tints = ((KEY, 1.15, (1.0, 0.95, 0.88)), (FILL, 0.32, (0.80, 0.90, 1.0)), (RIM, 0.6, (0.95, 0.97, 1.0)))
    for direction, power, tint in tints:
        towards = axes @ direction
        clear = 1.0 if shadow is None else np.exp(-0.8 * shadow.depth(points + 0.004 * normals, towards))[:, None]
        facing = (normals @ towards)[:, None]
        # Light scattered under the skin reaches past the edge of the shadow, reddish.
        soft = np.clip((facing + 0.25) / 1.25, 0, 1) ** 1.5 * np.array([1, 0.92, 0.88]) + 0.04
        light += power * clear * soft * np.array(tint)
    sky = np.clip(0.5 + 0.5 * (normals @ (axes @ np.array([0, 1.0, 0])))[:, None], 0, 1)
    if shadow is not None:
        sky = sky * np.exp(-0.5 * shadow.depth(points + 0.004 * normals, axes @ np.array([0, 0.8, 0.6])))[:, None]
    edge = (1 - np.clip(normals @ to_eye, 0, 1)[:, None]) ** 3
    return srgb(albedo * (light + 0.28 * sky * np.array([0.85, 0.92, 1.0])) + 0.05 * edge * sky)


def backdrop(width: int, height: int) -> np.ndarray:
    """A soft studio background (height, width, 3) uint8."""
    y, x = np.mgrid[0:height, 0:width]
    far = np.hypot((x / width - 0.5) * 1.1, y / height - 0.42)
    light = np.clip(0.60 - 0.42 * far, 0, 1)[..., None]
    return (255 * light * np.array([0.96, 0.99, 1.04])).clip(0, 255).astype(np.uint8)


class ShadowMap:
    """How much hair is between a point and a distant light.

    Seen from each light, strand vertices fall into the cells of a box, and each column is summed from the light on.

    Args:
        points: (P, 3) [m].
        area: area that each vertex covers [m^2].
    """

    def __init__(self, points: np.ndarray, area: np.ndarray):
        # Single precision is coarse far from the origin.
        self._middle = np.mean(points, axis=0)
        self._points, self._area = (points - self._middle).astype(np.float32), area
        self._columns: dict[bytes, tuple] = {}

    def depth(self, queries: np.ndarray, towards: np.ndarray) -> np.ndarray:
        """Optical depth (Q,) of the hair in front of each query (Q, 3) [m]; light comes from `towards`."""
        axes, low, cell, summed = self._seen_from(towards)
        # One array per coordinate: several times as fast as rows of three.
        place = (axes.T @ (queries - self._middle).T.astype(np.float32) - low[:, None]) / cell
        # Half a cell towards the light, or a vertex would be in its own shadow.
        place[0] += np.float32(0.5)
        last = np.array(summed.shape, np.float32)[:, None] - 1
        outside = ((place[1:] < 0) | (place[1:] > last[1:])).any(axis=0)
        np.clip(place, 0, last - np.float32(1e-3), out=place)
        corner = place.astype(np.int32)
        part = place - corner
        layer, row = summed.shape[1] * summed.shape[2], summed.shape[2]
        index, flat = corner[0] * layer + corner[1] * row + corner[2], summed.ravel()
        (behind, left, low_), (ahead, right, high) = 1 - part, part
        result = np.zeros(len(queries), np.float32)
        for forth, along in ((0, behind), (layer, ahead)):
            for aside, across in ((0, left), (row, right)):
                pair = flat.take(index + (forth + aside)) * low_
                pair += flat.take(index + (forth + aside + 1)) * high
                result += pair * (along * across)
        result[outside] = 0
        return result

    def _seen_from(self, towards):
        """Light axes, the box's low corner, its cell [m], and the hair from each cell on towards the light."""
        towards = np.asarray(towards, np.float32)
        key = towards.tobytes()
        if key not in self._columns:
            side = np.cross(towards, [0.0, 1.0, 0.0] if abs(towards[1]) < 0.9 else [1.0, 0.0, 0.0])
            side /= np.linalg.norm(side)
            # The axis towards the light comes first: whole layers are summed at once.
            axes = np.stack([towards, side, np.cross(towards, side)], axis=1).astype(np.float32)
            seen = axes.T @ self._points.T
            low, high = seen.min(axis=1), seen.max(axis=1)
            cell = np.float32(max(CELL, float((high - low).max()) / MOST_CELLS))
            shape = ((high - low) / cell).astype(int) + 4
            low = low - np.float32(1.5) * cell
            index = np.ravel_multi_index(((seen - low[:, None]) / cell + np.float32(0.5)).astype(int), shape)
            grid = np.bincount(index, self._area / cell**2, int(np.prod(shape))).reshape(shape).astype(np.float32)
            np.minimum(grid, np.float32(MOST_DEPTH), out=grid)
            for layer in range(len(grid) - 2, -1, -1):
                grid[layer] += grid[layer + 1]
            self._columns[key] = axes, low, cell, grid
        return self._columns[key]


def srgb(linear: np.ndarray) -> np.ndarray:
    """Linear light to display values in 0..1, with a soft shoulder instead of clipped highlights."""
    toned = 1 - np.exp(-1.25 * np.maximum(linear, 0).astype(np.float32))
    return np.clip(np.where(toned < 0.0031308, 12.92 * toned, 1.055 * toned ** (1 / 2.4) - 0.055), 0, 1)


def _highlight(along, across, shift, sharpness):
    """sin^(2 sharpness) of the angle (S, N) between the half vector and the tangent, bent outward by a part of its length.

    `along` and `across` (S, N) are the half vector's parts along the tangent and along outward, which is perpendicular to it.
    """
    cosine = (along + shift * across) / np.sqrt(1 + shift**2)
    return np.exp(sharpness * np.log1p(-np.minimum(cosine**2, 0.999999)))


def _unit(vectors):
    """(S, N, 3) of length one."""
    return vectors / np.maximum(np.sqrt(np.einsum("snc,snc->sn", vectors, vectors)), 1e-9)[..., None]


def _smoothed(values):
    result = values.copy()
    result[:, 1:-1] = 0.25 * values[:, :-2] + 0.5 * values[:, 1:-1] + 0.25 * values[:, 2:]
    return result
