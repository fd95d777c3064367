# SPDX-License-Identifier: Apache-2.0
"""Motion of a USD file that a training cannot learn from, or learns otherwise."""

import pytest
from pxr import UsdSkel

from neuralocks_core.errors import NeuralocksError
from usd.models.clip_file import read_clip
from usd.shot.stage import read_rigs

from ..shots import MOTION, PARENTS, RIG, edited, write_shot


def _bare(stage):
    stage.RemovePrim("/Hero")


def _still(stage):
    UsdSkel.BindingAPI(stage.GetPrimAtPath(RIG)).GetAnimationSourceRel().SetTargets([])


def _hidden(stage):
    motion = UsdSkel.Animation(stage.GetPrimAtPath(MOTION))
    scales = list(motion.GetScalesAttr().Get(3))
    scales[PARENTS.index(2)] = (0, 0, 0)
    for code in range(1, 10):
        motion.GetScalesAttr().Set(scales if code == 3 else [(1, 1, 1)] * len(scales), code)


def _unbound(stage):
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath(RIG))
    skeleton.GetBindTransformsAttr().Set(skeleton.GetBindTransformsAttr().Get()[:3])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_bare, "holds no UsdSkel skeleton; give motion of the character's joints, or BVH"),
        (_still, "its skeleton has no animation; give a moving one"),
        (_hidden, "/Hero/Rig: joint '.*' has zero scale at time code 3"),
        (_unbound, "/Hero/Rig: 3 bindTransforms for 8 joints"),
    ],
)
def test_motion_that_cannot_be_learned_from_is_refused_by_its_file(tmp_path, change, words):
    """Of `--motion clips/*.usd`, whose skeletons all have the same path."""
    character = read_rigs(write_shot(tmp_path, name="character"))[0].character
    with pytest.raises(NeuralocksError, match=f"shot.usda: {words}"):
        read_clip(str(edited(tmp_path, change)), character)
