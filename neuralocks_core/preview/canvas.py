# SPDX-License-Identifier: Apache-2.0
"""Coloured triangles and lines to an image, without a display: by VTK, or by numpy where VTK cannot draw."""

from dataclasses import dataclass

import numpy as np

ANGLE = 24.0
"""Of a picture's height, as its camera sees it [degrees]."""


@dataclass(frozen=True)
class Camera:
    """A pinhole camera of a view ANGLE.

    Attributes:
        eye, target: (3,) [m].
        up: unit vector (3,).
    """

    eye: np.ndarray
    target: np.ndarray
    up: np.ndarray

    @property
    def to_eye(self) -> np.ndarray:
        """Unit vector (3,) from the target towards the eye."""
        way = self.eye - self.target
        return way / np.linalg.norm(way)


def backdrop(width: int, height: int) -> np.ndarray:
    """A soft studio background (height, width, 3) uint8."""
    y, x = np.mgrid[0:height, 0:width]
    far = np.hypot((x / width - 0.5) * 1.1, y / height - 0.42)
    light = np.clip(0.60 - 0.42 * far, 0, 1)[..., None]
    return (255 * light * np.array([0.96, 0.99, 1.04])).clip(0, 255).astype(np.uint8)


class VtkCanvas:
    """Draws with VTK in an off-screen window, larger than asked for and then reduced.

    Args:
        width, height: of a picture in pixels.
        triangles: of the body (F, 3) int; none where it is not drawn.
        strands: how many there will be in each picture, of `detail.vertices` points each.
        detail: how finely; see `film.Detail`.

    Raises:
        RuntimeError, ImportError: VTK is missing or has no way to draw here.
    """

    def __init__(self, width: int, height: int, triangles: np.ndarray, strands: int, detail):
        import pyvista

        vertices, scale = detail.vertices, detail.scale
        self.size, self._pyvista, self._width = (width, height), pyvista, detail.width
        pyvista.vtk_verbosity("off")
        self._plotter = pyvista.Plotter(off_screen=True, window_size=(round(width * scale), round(height * scale)))
        self._plotter.render_window.SetMultiSamples(detail.samples)
        self._plotter.set_background("black")
        self._body = self._hair = None
        self._faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
        index = np.arange(strands * vertices).reshape(strands, vertices)
        self._lines = np.column_stack([np.full(strands, vertices), index]).ravel()
        self._backdrop = backdrop(width, height).astype(np.float32)

    def draw(self, camera: Camera, body, body_colours, hair, hair_colours) -> np.ndarray:
        """An image (height, width, 3) uint8.

        Args:
            camera: what it is seen by.
            body: points (V, 3) [m], or None for no body; body_colours: (V, 3) sRGB in 0..1.
            hair: points (P, 3) [m], strand after strand; hair_colours: (P, 3).
        """
        body_colours, hair_colours = ((255 * c).astype(np.uint8) for c in (body_colours, hair_colours))
        if len(hair):
            if self._hair is None:
                self._hair = self._pyvista.PolyData(hair, lines=self._lines)
                self._hair["rgb"] = hair_colours
                self._plotter.add_mesh(self._hair, scalars="rgb", rgb=True, lighting=False, line_width=self._width)
            self._hair.points, self._hair["rgb"] = hair, hair_colours
        if body is not None:
            if self._body is None:
                self._body = self._pyvista.PolyData(body, faces=self._faces)
                self._body["rgb"] = body_colours
                self._plotter.add_mesh(self._body, scalars="rgb", rgb=True, lighting=False)
            self._body.points, self._body["rgb"] = body, body_colours
        view = self._plotter.camera
        view.position, view.focal_point, view.up = camera.eye, camera.target, camera.up
        view.view_angle = ANGLE
        far = np.linalg.norm(camera.eye - camera.target)
        view.clipping_range = (0.2 * far, 4 * far)
        self._plotter.render()
        image = self._plotter.screenshot(return_img=True, transparent_background=True)
        return composite(image, self.size, self._backdrop)

    def close(self) -> None:
        """Free the window."""
        self._plotter.close()


class PlainCanvas:
    """Draws by sampling every triangle and segment a pixel or so apart and keeping the nearest sample.

    Slower and plainer than VTK, and works wherever numpy does. Arguments as `VtkCanvas`.
    """

    def __init__(self, width: int, height: int, triangles: np.ndarray, strands: int, detail):
        self.size, self._scale = (width, height), detail.scale
        self._triangles, self._shape = triangles, (strands, detail.vertices)
        self._backdrop = backdrop(width, height).astype(np.float32)

    def draw(self, camera: Camera, body, body_colours, hair, hair_colours) -> np.ndarray:
        """See `VtkCanvas.draw`."""
        wide, high = (round(side * self._scale) for side in self.size)
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
        return composite(image, self.size, self._backdrop)

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


def composite(image: np.ndarray, size: tuple[int, int], backdrop: np.ndarray) -> np.ndarray:
    """A drawing (H, W, 4) uint8 with coverage, reduced to a size and laid over the backdrop (height, width, 3)."""
    from PIL import Image

    # Colours multiplied by the coverage before they are reduced, and left so: the edge of hair gets no fringe.
    small = Image.fromarray(image, "RGBA").convert("RGBa").resize(size, Image.Resampling.BOX)
    small = np.frombuffer(small.tobytes(), np.uint8).reshape(*size[::-1], 4).astype(np.float32)
    return (small[..., :3] + backdrop * (1 - small[..., 3:] / 255)).clip(0, 255).astype(np.uint8)


def open_canvas(width, height, triangles, strands, detail) -> VtkCanvas | PlainCanvas:
    """The best canvas that works here, for so many strands of `detail.vertices` points (see `film.Detail`)."""
    canvas = None
    try:
        canvas = VtkCanvas(width, height, triangles, strands, detail)
        canvas._plotter.render()
        return canvas
    except Exception:  # a missing wheel, library or driver each raises something of its own
        if canvas is not None:
            canvas.close()
        return PlainCanvas(width, height, triangles, strands, detail)


def _project(camera: Camera, points: np.ndarray, high: int) -> np.ndarray:
    """Pixels right and up of the middle, and depth [m], (N, 3)."""
    back = camera.to_eye
    right = np.cross(camera.up, back)
    right /= np.linalg.norm(right)
    seen = (points - camera.eye) @ np.stack([right, np.cross(back, right), -back], axis=1)
    focal = high / 2 / np.tan(np.radians(ANGLE) / 2)
    depth = np.maximum(seen[:, 2:], 1e-6)
    return np.concatenate([focal * seen[:, :2] / depth, seen[:, 2:]], axis=1)
