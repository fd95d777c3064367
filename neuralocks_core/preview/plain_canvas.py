# SPDX-License-Identifier: Apache-2.0
"""Draws with numpy alone, where OpenGL cannot draw."""

import numpy as np

from neuralocks_core.preview.camera import ANGLE, Camera
from neuralocks_core.preview.shading import backdrop

LONGEST = 64
"""Most samples of a segment, and along each side of a triangle."""


class PlainCanvas:
    """Draws by sampling every triangle and segment a pixel or so apart and keeping the nearest sample in each pixel.

    Slower and plainer than OpenGL, but works wherever numpy does. Arguments as for `GlCanvas`.
    """

    def __init__(self, width: int, height: int, triangles: np.ndarray, strands: int, detail):
        self._scale, self._width = detail.scale, detail.width
        self._wide, self._high = width * detail.scale, height * detail.scale
        self._triangles, self._shape = triangles, (strands, detail.vertices)
        self._backdrop = backdrop(width, height)

    def draw(self, camera: Camera, body, body_colours, hair, hair_colours) -> np.ndarray:
        """See `GlCanvas.draw`."""
        samples = []
        if len(hair):
            samples += self._segments(self._project(camera, hair), _packed(hair_colours))
        if body is not None:
            samples += self._surface(self._project(camera, body), body_colours.astype(np.float32))
        image = np.zeros(self._wide * self._high, np.uint32)
        if samples:
            pixel, depth, colour = (np.concatenate(parts) for parts in zip(*samples, strict=True))
            # Far samples first: the last one written to a pixel is the nearest. 16-bit numbers are radix-sorted.
            near, far = depth.min(), depth.max()
            rank = (65535 * ((far - depth) / max(far - near, 1e-9))).astype(np.uint16)
            order = np.argsort(rank, kind="stable")
            image[pixel[order]] = colour[order]
        return composite(image.view(np.uint8).reshape(self._high, self._wide, 4), self._scale, self._backdrop)

    def close(self) -> None:
        """Nothing to free."""

    def _project(self, camera: Camera, points: np.ndarray) -> np.ndarray:
        """Pixels right and down from the upper left corner, and depth [m], (N, 3)."""
        seen = (points - camera.eye) @ (camera.axes * [1, -1, -1])
        focal = self._high / 2 / np.tan(np.radians(ANGLE) / 2)
        depth = seen[:, 2:]
        place = focal * seen[:, :2] / np.maximum(depth, 1e-6) + [self._wide / 2, self._high / 2]
        return np.concatenate([place, depth], axis=1).astype(np.float32)

    def _segments(self, seen: np.ndarray, colours: np.ndarray) -> list[tuple]:
        """Samples of the strands, as wide as asked for across each segment: pixel, depth and packed colour (n,)."""
        seen = seen.reshape(*self._shape, 3)
        start, way = seen[:, :-1].reshape(-1, 3), np.diff(seen, axis=1).reshape(-1, 3)
        run = np.abs(way[:, :2])
        steps = np.ceil(run.max(axis=1)).clip(1, LONGEST).astype(int)
        which = np.repeat(np.arange(len(steps)), steps)
        part = (np.arange(len(which)) - (np.cumsum(steps) - steps)[which]) / steps[which].astype(np.float32)
        place = start[which] + part[:, None] * way[which]
        # The colour of the nearer end: the ends are close together, and mixing would cost as much as all the rest.
        colour = colours.reshape(self._shape)[:, :-1].ravel()[which]
        result = []
        for aside in np.arange(self._width) - (self._width - 1) // 2:
            shift = np.where(run[:, :1] > run[:, 1:], [0, aside], [aside, 0]).astype(np.float32)
            result.append(self._kept(place[:, 0] + shift[which, 0], place[:, 1] + shift[which, 1], place[:, 2], colour))
        return result

    def _surface(self, seen: np.ndarray, colours: np.ndarray) -> list[tuple]:
        """Samples of the triangles in the picture, as in `_segments`; of both sides, because hair cards are open."""
        corners = seen[self._triangles]
        low, high = corners[..., :2].min(axis=1), corners[..., :2].max(axis=1)
        shown = (high >= 0).all(axis=1) & (low < [self._wide, self._high]).all(axis=1)
        corners, tint = corners[shown], colours[self._triangles[shown]]
        size = np.ceil(1.5 * (high - low)[shown].max(axis=1)).clip(1, LONGEST).astype(int)
        result = []
        for n in np.unique(size):
            i, j = np.mgrid[0 : n + 1, 0 : n + 1]
            half = i + j <= n
            weights = np.stack([i[half], j[half], n - i[half] - j[half]], axis=1).astype(np.float32) / n
            chosen = size == n
            x, y, depth = np.moveaxis(weights @ corners[chosen], 2, 0).reshape(3, -1)
            result.append(self._kept(x, y, depth, _packed((weights @ tint[chosen]).reshape(-1, 3))))
        return result

    def _kept(self, x, y, depth, colour) -> tuple:
        """Those of samples (n,) in front of the camera and in the picture: pixel, depth, colour."""
        kept = (x >= 0) & (x < self._wide) & (y >= 0) & (y < self._high) & (depth > 0)
        return y[kept].astype(np.int32) * self._wide + x[kept].astype(np.int32), depth[kept], colour[kept]


def composite(image: np.ndarray, scale: int, backdrop: np.ndarray) -> np.ndarray:
    """A drawing (scale H, scale W, 4) uint8, reduced and laid over the backdrop (H, W, 3).

    Its colours are already multiplied by its coverage, which is 0 or 255: the edge of hair gets no fringe.
    """
    total = np.zeros((*backdrop.shape[:2], 4), np.uint32)
    for row in range(scale):
        for column in range(scale):
            total += image[row::scale, column::scale]
    small = total / np.float32(scale**2)
    return (small[..., :3] + backdrop * (1 - small[..., 3:] / 255)).clip(0, 255).astype(np.uint8)


def _packed(colours: np.ndarray) -> np.ndarray:
    """Colours (n, 3) in 0..1 as red, green, blue and full coverage, a byte each in one number (n,)."""
    result = np.full((len(colours), 4), 255, np.uint8)
    result[:, :3] = 255 * colours
    return result.view(np.uint32).ravel()
