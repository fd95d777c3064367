# SPDX-License-Identifier: Apache-2.0
"""Normals of a sphere point outward, however its triangles differ in size; a vertex of no face has none."""

import numpy as np
import trimesh

from neuralocks_core.normals import vertex_normals


def test_normals_of_a_sphere_are_its_directions():
    ball = trimesh.creation.uv_sphere(radius=0.1, count=[40, 40])
    normals = vertex_normals(np.vstack([ball.vertices, np.ones(3)]), ball.faces)
    assert (normals[:-1] * ball.vertices).sum(axis=1).min() > 0.0999 and not normals[-1].any()
    np.testing.assert_allclose(vertex_normals(ball.vertices.astype(np.float32), ball.faces), normals[:-1], atol=1e-5)
