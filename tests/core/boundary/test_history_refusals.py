# SPDX-License-Identifier: Apache-2.0
"""Descriptions, materials, poses and shapes of which no boundary history is made."""

import numpy as np
import pytest

from neuralocks_core.boundary.history import BoundarySampler
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import Clip
from tests.core.rigs import moved, person

SPEC = BoundarySpec(bins=(1,) * 30, taper=0.0)


def test_unknown_description_asks_for_an_update():
    with pytest.raises(NeuralocksError, match="update"):
        BoundarySpec.from_json({**SPEC.to_json(), "wind": True})
    assert BoundarySpec.from_json(SPEC.to_json()) == SPEC


@pytest.mark.parametrize(
    "values",
    [
        {"bins": ["x"]},
        {"bins": [float("inf")]},
        {"bins": [1.5]},
        {"bins": (1.0,)},
        {"bins": 3},
        {"bins": [0]},
        {"bins": [2] * 1001},
        {"dt": "a"},
        {"dt": None},
        {"dt": float("nan")},
        {"taper": "a"},
        {"taper": -0.1},
        {"chest": 5},
        {"linear": []},
        {"pose_joints": [[]]},
        {"pose_joints": []},
        {"pose_joints": 1},
        [],
    ],
    ids=str,
)
def test_an_impossible_description_is_refused_in_one_line(values):
    with pytest.raises(NeuralocksError, match="^model: "):
        BoundarySpec.from_json(values)
    if isinstance(values, dict):
        with pytest.raises(NeuralocksError, match="^model: "):
            BoundarySpec(**values)


@pytest.mark.parametrize(
    ("change", "fact"),
    (
        ({"material": [np.nan] * 4}, "material .*give 4 log-ratios"),
        ({"material": [0.0] * 3}, "material .*give 4 log-ratios"),
        ({"material": "soft"}, "material: is not an array of numbers; give .4,. log-ratios"),
        ({"strength": np.nan}, "strength nan: give a number"),
        ({"strength": "1"}, "strength 1: give a number"),
        ({"strength": -1.0}, "strength -1.0: give a number of at least 0"),
        ({"strength": np.inf}, "strength inf: give a number of at least 0"),
        ({"strength": [1.0, 2.0]}, "strength .1.0, 2.0.: give a number"),
        ({"wind": (0, 0, 2)}, "wind .0, 0, 2.: is not a wind; give a .*Wind"),
        ({"joints": [[1], [2, 3]]}, "joints: is not an array of numbers; give .1, 6, 4, 4."),
        ({"joints": np.eye(4)}, "joints: are of shape .* give .1, 6, 4, 4."),
    ),
)
def test_what_is_no_material_strength_or_pose_is_refused(change, fact):
    sampler = BoundarySampler(BoundarySpec(), person(), moved([0.0, 1.0]))
    with pytest.raises(NeuralocksError, match=fact):
        sampler.vectors([0.5], **change)
    if "material" in change:
        with pytest.raises(NeuralocksError, match=fact):
            sampler.held_bind(**change)


@pytest.mark.parametrize("shape", [[0.1], [np.nan, 0.0], [[0.1, 0.2]], 0.1, "thin"])
def test_a_held_body_has_the_clips_blend_shapes(shape):
    clip = moved([0.0, 1.0])
    sampler = BoundarySampler(BoundarySpec(), person(), Clip(clip.times, clip.joints, np.zeros((len(clip.times), 2))))
    assert np.array_equal(sampler.held_bind(), sampler.held_bind(shape=[0.0, 0.0]))
    with pytest.raises(NeuralocksError, match=r"^shape.*: .*give \(2,\) blend shape weights"):
        sampler.held_bind(shape=shape)
