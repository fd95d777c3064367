# SPDX-License-Identifier: Apache-2.0
"""Draws with numpy alone, where OpenGL cannot draw."""

import numpy as np

from neuralocks_core.preview.camera import ANGLE, Camera
from neuralocks_core.preview.shading import backdrop


class PlainCanvas:
    """Draws by sampling every triangle and segment a pixel or so apart and keeping the nearest sample.

    Slower and plainer than OpenGL, and works wherever numpy does. Arguments as of `GlCanvas`.
    """

    def __init__(self, width: int, height: int, triangles: np.ndarray, strands: int, detail):
        self.size, self._scale = (width, height), detail.scale
        self._triangles, self._shape = triangles, (strands, detail.vertices)
        self._backdrop = backdrop(width, height)

    def draw(self, camera: Camera, body, body_colours, hair, hair_colours) -> np.ndarray:
        """See `GlCanvas.draw`."""
        wide, high = (side * self._scale for side in self.size)
        samples = [self._segments(camera, hair, hair_colours, high)]
        if body is not None:
            samples.append(self._surface(camera, body, body_colours, high))
        x, y, depth, colour = (np.concatenate(parts) for parts in zip(*samples, strict=True))
        pixel_x, pixel_y = (x + wide / 2).astype(int), (high / 2 - y).astype(int)
        kept = (pixel_x >= 0) & (pixel_x < wide) & (pixel_y >= 0) & (pixel_y < high) & (depth > 0)
        order = np.flatnonzero(kept)[np.argsort(-depth[kept], kind="stable")]
        image = np.zeros((high, wide, 4), np.uint8)
        # Far samples first: the last one written to a pixel is the nearest.
        image[pixel_y[order], pixel_x[order], :3] = (255 * colour[order]).astype(np.uint8)
        image[pixel_y[order], pixel_x[order], 3] = 255
        return composite(image, self._scale, self._backdrop)

    def close(self) -> None:
        """Nothing to free."""

    def _segments(self, camera, hair, colours, high):
        seen = _project(camera, hair, high).reshape(*self._shape, 3)
        tint = colours.reshape(*self._shape, 3)
        steps = int(np.clip(np.ceil(np.abs(np.diff(seen[..., :2], axis=1)).max(initial=1)), 1, 24))
        t = (np.arange(steps) / steps)[None, None, :, None]
        place = seen[:, :-1, None] * (1 - t) + seen[:, 1:, None] * t
        shade = tint[:, :-1, None] * (1 - t) + tint[:, 1:, None] * t
        place, shade = place.reshape(-1, 3), shade.reshape(-1, 3)
        return place[:, 0], place[:, 1], place[:, 2], shade

    def _surface(self, camera, body, colours, high):
        seen = _project(camera, body, high)[self._triangles]
        (ax, ay), (bx, by) = (seen[:, 1, :2] - seen[:, 0, :2]).T, (seen[:, 2, :2] - seen[:, 0, :2]).T
        shown = ax * by - ay * bx > 0
        seen, tint = seen[shown], colours[self._triangles[shown]]
        size = np.ceil(1.5 * np.abs(seen[:, [1, 2, 0], :2] - seen[:, :, :2]).max(axis=(1, 2))).clip(1, 60).astype(int)
        parts = []
        for n in np.unique(size):
            i, j = np.mgrid[0 : n + 1, 0 : n + 1]
            inside = i + j <= n
            weights = np.stack([i[inside], j[inside], n - i[inside] - j[inside]], axis=1) / n
            chosen = size == n
            parts.append(np.concatenate([weights @ seen[chosen], weights @ tint[chosen]], axis=2).reshape(-1, 6))
        both = np.concatenate(parts) if parts else np.zeros((0, 6))
        return both[:, 0], both[:, 1], both[:, 2], both[:, 3:]


def composite(image: np.ndarray, scale: int, backdrop: np.ndarray) -> np.ndarray:
    """A drawing (scale H, scale W, 4) uint8, reduced and laid over the backdrop (H, W, 3).

    Its colours are multiplied by its coverage already, which is 0 or 255: the edge of hair gets no fringe.
    """
    high, wide, _ = backdrop.shape
    small = image.reshape(high, scale, wide, scale, 4).mean(axis=(1, 3))
    return (small[..., :3] + backdrop * (1 - small[..., 3:] / 255)).clip(0, 255).astype(np.uint8)


def _project(camera: Camera, points: np.ndarray, high: int) -> np.ndarray:
    """Pixels right and up of the middle, and depth [m], (N, 3)."""
    seen = (points - camera.eye) @ (camera.axes * [1, 1, -1])
    focal = high / 2 / np.tan(np.radians(ANGLE) / 2)
    depth = np.maximum(seen[:, 2:], 1e-6)
    return np.concatenate([focal * seen[:, :2] / depth, seen[:, 2:]], axis=1)
