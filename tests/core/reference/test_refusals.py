# SPDX-License-Identifier: Apache-2.0
"""What the reference refuses, with a clear word; what XPBD reads, too, it refuses alike."""

import re

import numpy as np
import pytest

pytest.importorskip("warp", reason="the reference needs warp")
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.reference import simulate, simulate_xpbd
from tests.core.reference.swinging_heads import groom, sphere


def longer(rest):
    """Rest points whose strands are a tenth longer from their second vertex on."""
    return np.concatenate([rest[:, :2], rest[:, 1:2] + 1.1 * (rest[:, 2:] - rest[:, 1:2])], axis=1)


@pytest.mark.parametrize(
    "change, word",
    [
        ({"rest": np.zeros((2, 24, 3))}, "without length"),
        ({"rest": np.full((2, 24, 3), np.nan)}, "not finite"),
        ({"head": np.diag([2.0, 2, 2, 1])[None]}, "scale"),
        ({"head": np.diag([1.01, 1.01, 1.01, 1])[None]}, r"scales, shears or mirrors \(determinant 1\.03\)"),
        ({"head": np.diag([1.25, 0.8, 1, 1])[None]}, r"head: frame 0 scales, shears or mirrors \(determinant 1\)"),
        ({"head": (np.eye(4) + np.eye(4, k=1) * [0, 0.3, 0, 0])[None]}, "shears"),
        ({"head": np.diag([-1.0, 1, 1, 1])[None]}, r"mirrors \(determinant -1\)"),
        ({"neighbours": np.array([[9]] * 4)}, "outside"),
        ({"material": {"bend": -1.0}}, "bend"),
        ({"device": "tpu"}, "device"),
        ({"substeps": 1.5}, "substeps 1.5"),
        ({"margin": np.nan}, "margin nan"),
        ({"start": np.full((4, 24, 3), np.nan)}, "start: holds NaN"),
        ({"tolerance": -1e-3}, "tolerance -0.001"),
        ({"collision": np.inf}, "collision inf"),
        ({"collision": "hard"}, "collision hard: must be a number"),
        ({"start": groom(4) + 0.5}, "start: a root is 0.866 m from that of rest; give vertices 0 and 1 as in rest"),
        ({"start": longer(groom(4))}, "start: an edge's length is off by 10 %; give edges as long as"),
        ({"start": "rest"}, "start: is not an array of numbers"),
        ({"rest": "abc"}, "rest: is not an array of numbers"),
        ({"head": "abc"}, "head: is not an array of numbers"),
        ({"wind": "abc"}, "wind: is not an array of numbers"),
        ({"body": np.zeros((1, 3, 3)), "triangles": [[0, 1, 2.4]]}, "triangles: are of type float64; give whole"),
        ({"body": ["abc"], "triangles": [[0, 1, 2]]}, "body: is not an array of numbers"),
        ({"planes": "no"}, "planes 'no': must be True or False"),
        ({"rest_support": None}, "rest_support None: must be True or False"),
    ],
)
def test_errors_name_the_argument(change, word):
    arguments = {"rest": groom(4), "head": np.eye(4)[None]} | change
    with pytest.raises(NeuralocksError, match=word):
        simulate(arguments.pop("rest"), arguments.pop("head"), **arguments)


@pytest.mark.parametrize("simulator", [simulate, simulate_xpbd])
@pytest.mark.parametrize(
    "change",
    [
        {"dt": 0.0},
        {"dt": "a"},
        {"substeps": 0},
        {"substeps": 1.5},
        {"substeps": 2.0},
        {"substeps": True},
        {"margin": np.nan},
        {"margin": -0.01},
        {"margin": "wide"},
        {"gravity": -9.81},
        {"gravity": np.nan},
        {"gravity": "down"},
    ],
)
def test_simulators_refuse_the_same_settings(simulator, change):
    with pytest.raises(NeuralocksError, match=f"{next(iter(change))} {next(iter(change.values()))}"):
        simulator(groom(4), np.eye(4)[None], **change)


@pytest.mark.parametrize("simulator", [simulate, simulate_xpbd])
@pytest.mark.parametrize(
    "name, frame, spoiled, word",
    [
        ("body", 1, lambda points: np.where(points > 0.09, np.nan, points), "holds values that are not finite"),
        ("body", 1, lambda points: points[:-1], "shape (265, 3); give the vertices of the first frame, (266, 3)"),
        ("bind_body", None, lambda points: points[:5], "shape (5, 3); give the vertices of the first frame"),
        ("bind_body", None, lambda points: points.ravel(), "shape (798,); give the vertices of the first frame"),
        ("bind_body", None, lambda points: np.full_like(points, np.inf), "holds values that are not finite"),
    ],
)
def test_simulators_refuse_a_body_that_hair_would_not_meet(simulator, name, frame, spoiled, word):
    points, faces = sphere()
    given = {"body": [points, points, points], "bind_body": points}
    if frame is None:
        given[name] = spoiled(points)
    else:
        given[name][frame] = spoiled(points)
    with pytest.raises(NeuralocksError, match=re.escape(f"{name}: {word}")):
        simulator(groom(2), np.tile(np.eye(4), (3, 1, 1)), triangles=faces, **given)


@pytest.mark.parametrize("simulator", [simulate, simulate_xpbd])
@pytest.mark.parametrize(
    "material, word",
    [
        ({"stiffness": 5e-3}, "material 'stiffness': unknown name; the known ones are bend, weight, damping, clumping"),
        ({"Bend": 5e-3}, "material 'Bend': unknown name"),
        ([5e-3, 2, 20, 0], "is not one; give a Material, or a dict of bend, weight"),
        ("bend=5e-3", "is not one; give a Material"),
        ({"bend": "5e-3"}, "material bend: is not an array of numbers"),
        ({"bend": True}, "material bend: give a number of at least 0"),
    ],
)
def test_simulators_refuse_a_material_that_they_would_not_read(simulator, material, word):
    with pytest.raises(NeuralocksError, match=word):
        simulator(groom(4), np.eye(4)[None], material=material)
