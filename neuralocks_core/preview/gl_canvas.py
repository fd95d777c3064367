# SPDX-License-Identifier: Apache-2.0
"""Draws with OpenGL, without a window: on the GPU, or by the software driver of a machine that has none."""

import sys

import moderngl
import numpy as np

from neuralocks_core.preview.camera import ANGLE, Camera
from neuralocks_core.preview.shading import backdrop

_PLACE = """
#version 330
uniform mat4 view;
in vec3 place;
in vec3 colour;
out vec3 tint;
void main() {
    gl_Position = view * vec4(place, 1);
    tint = colour;
}
"""
_TINT = """
#version 330
in vec3 tint;
out vec4 pixel;
void main() { pixel = vec4(tint, 1); }
"""
# One triangle that covers the picture.
_WHOLE = """
#version 330
void main() { gl_Position = vec4(gl_VertexID % 2 * 4 - 1, gl_VertexID / 2 * 4 - 1, 0, 1); }
"""
# The drawing's colours are already multiplied by its coverage, which is 0 or 1: the edge of hair gets no fringe.
_REDUCE = """
#version 330
uniform sampler2D drawing;
uniform sampler2D backdrop;
uniform int scale;
out vec3 pixel;
void main() {
    ivec2 place = ivec2(gl_FragCoord.xy);
    vec4 sum = vec4(0);
    for (int x = 0; x < scale; x++)
        for (int y = 0; y < scale; y++)
            sum += texelFetch(drawing, place * scale + ivec2(x, y), 0);
    sum /= float(scale * scale);
    pixel = sum.rgb + (1 - sum.a) * texelFetch(backdrop, place, 0).rgb;
}
"""


class GlCanvas:
    """Draws with OpenGL 3.3 at a larger size, then reduces the picture.

    It belongs to the thread that made it.

    Args:
        width, height: of a picture in pixels.
        triangles: of the body (F, 3) int; none if it is not drawn.
        strands: number of strands in each picture, of `detail.vertices` points each.
        detail: how finely; see `film.Detail`.

    Raises:
        Exception: drawing is impossible here; its type depends on the driver.
    """

    def __init__(self, width: int, height: int, triangles: np.ndarray, strands: int, detail):
        self.size, self._width = (width, height), detail.width
        self._context = _context()
        try:
            self._fit_out(triangles, strands, detail)
        except BaseException:
            self.close()
            raise

    def _fit_out(self, triangles: np.ndarray, strands: int, detail) -> None:
        """Create everything that a picture needs in the current context."""
        context, (width, height) = self._context, self.size
        large = (width * detail.scale, height * detail.scale)
        self._drawing = context.texture(large, 4)
        self._large = context.framebuffer([self._drawing], context.depth_renderbuffer(large))
        self._small = context.framebuffer([context.texture(self.size, 3)])
        self._backdrop = context.texture(self.size, 3, backdrop(width, height)[::-1].tobytes(), alignment=1)
        self._coloured = context.program(_PLACE, _TINT)
        self._reduce = context.program(_WHOLE, _REDUCE)
        self._reduce["drawing"], self._reduce["backdrop"], self._reduce["scale"] = 0, 1, detail.scale
        self._screen = context.vertex_array(self._reduce, [])
        index = np.arange(strands * detail.vertices).reshape(strands, detail.vertices)
        self._hair = self._shape(np.stack([index[:, :-1], index[:, 1:]], axis=-1))
        self._body = self._shape(triangles)

    def draw(self, camera: Camera, body, body_colours, hair, hair_colours) -> np.ndarray:
        """An image (height, width, 3) uint8.

        Args:
            camera: the camera of the picture.
            body: points (V, 3) [m], or None for no body; body_colours: (V, 3) sRGB in 0..1.
            hair: points (P, 3) [m], strand after strand; hair_colours: (P, 3).
        """
        with self._context as context:
            self._coloured["view"].write(_view(camera, self.size[0] / self.size[1]).T.astype("f4").tobytes())
            context.enable_only(moderngl.DEPTH_TEST)
            context.line_width = self._width  # a driver may support only lines of one pixel
            self._large.use()
            self._large.clear()
            if body is not None:
                self._fill(self._body, body - camera.eye, body_colours, moderngl.TRIANGLES)
            if len(hair):
                self._fill(self._hair, hair - camera.eye, hair_colours, moderngl.LINES)
            context.disable(moderngl.DEPTH_TEST)
            self._small.use()
            self._drawing.use(0)
            self._backdrop.use(1)
            self._screen.render(moderngl.TRIANGLES, vertices=3)
            pixels = np.frombuffer(self._small.read(alignment=1), np.uint8)
        return np.ascontiguousarray(pixels.reshape(*self.size[::-1], 3)[::-1])

    def close(self) -> None:
        """Free the driver's resources."""
        self._context.release()

    def _shape(self, cells: np.ndarray):
        """Buffers of the points and colours that cells name by number, and the array that draws them; None without cells."""
        if not cells.size:
            return None
        context, points = self._context, int(cells.max()) + 1
        place, colour = context.buffer(reserve=12 * points), context.buffer(reserve=3 * points)
        index = context.buffer(np.ascontiguousarray(cells, "i4"))
        return (
            place,
            colour,
            context.vertex_array(self._coloured, [(place, "3f", "place"), (colour, "3f1", "colour")], index),
        )

    def _fill(self, shape, points: np.ndarray, colours: np.ndarray, kind: int) -> None:
        if shape is None:
            return
        place, colour, cells = shape
        place.write(np.ascontiguousarray(points, "f4")[: place.size // 12])
        colour.write((255 * colours).astype(np.uint8)[: place.size // 12])
        cells.render(kind)


def _context() -> moderngl.Context:
    """EGL needs no display; outside Linux, the default needs none either."""
    if sys.platform == "linux":
        try:
            return moderngl.create_context(standalone=True, backend="egl")
        except Exception:  # the library raises nothing finer
            pass
    return moderngl.create_context(standalone=True)


def _view(camera: Camera, aspect: float) -> np.ndarray:
    """Matrix (4, 4) that takes points (x, y, z, 1) [m] from the eye, in world axes, to OpenGL's clip space.

    Single precision, in which it draws, is coarse far from the origin.
    """
    turned = np.eye(4)
    turned[:3, :3] = camera.axes.T
    distance = np.linalg.norm(camera.eye - camera.target)
    near, far = 0.2 * distance, 4 * distance
    zoom = 1 / np.tan(np.radians(ANGLE) / 2)
    project = np.diag([zoom / aspect, zoom, (near + far) / (near - far), 0])
    project[2, 3], project[3, 2] = 2 * near * far / (near - far), -1
    return project @ turned
