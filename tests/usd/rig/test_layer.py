# SPDX-License-Identifier: Apache-2.0
"""What a rig bake's layer takes over from a shot: its binding, faces, and joints that its animation leaves out or makes up."""

import numpy as np
from pxr import Gf, Usd, UsdSkel, Vt

from usd.rig.bake import bake_rig
from usd.rig.stage import read_rigged_hair

from ..rig_shots import hair_turns, model_for, rotations, small_shot


def test_a_skeleton_that_inherits_its_animation_plays_that_of_the_bake(edited, tmp_path):
    """USD reads no binding of a prim that does not have its API, which a shot need not have applied to the skeleton. What a face shows
    at no time stays, too.
    """

    def change(stage):
        skeleton = stage.GetPrimAtPath("/Who/Rig")
        UsdSkel.BindingAPI(skeleton).GetAnimationSourceRel().ClearTargets(True)
        skeleton.RemoveAPI(UsdSkel.BindingAPI)
        root = UsdSkel.BindingAPI.Apply(stage.GetPrimAtPath("/Who"))
        root.CreateAnimationSourceRel().SetTargets(["/Who/Motion"])
        UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion")).GetBlendShapeWeightsAttr().Set([0.5])

    shot = edited(change)
    baked = Usd.Stage.Open(str(bake_rig(shot, tmp_path / "out.usda", model_for(read_rigged_hair(shot))).path))
    skeleton = UsdSkel.Skeleton(baked.GetPrimAtPath("/Who/Rig"))
    cache = UsdSkel.Cache()
    cache.Populate(UsdSkel.Root(baked.GetPrimAtPath("/Who")), Usd.PrimDefaultPredicate)
    played = cache.GetSkelQuery(skeleton).GetAnimQuery().GetPrim()
    assert str(played.GetPath()) == "/Who/Rig/NeuralocksHair"
    weights = UsdSkel.Animation(played).GetBlendShapeWeightsAttr()
    assert list(weights.Get()) == [0.5] and list(weights.Get(3)) == [0.25]


def test_hair_that_the_animation_leaves_out_hangs_from_where_it_rests(edited, tmp_path):
    """In any order of its joints, also beside such as the skeleton does not have."""
    listed = ["hips/head", "ghost", "hips"]

    def change(stage):
        motion = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion"))
        for channel in (motion.GetTranslationsAttr(), motion.GetRotationsAttr(), motion.GetScalesAttr()):
            for code in channel.GetTimeSamples() or [Usd.TimeCode.Default()]:
                hips, head = list(channel.Get(code))[:2]
                channel.Set([head, hips, hips], code)
        motion.GetJointsAttr().Set(listed)
        skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath("/Who/Rig"))
        rest = list(skeleton.GetRestTransformsAttr().Get())
        rest[3] = Gf.Matrix4d().SetScale((1, 2, 1)) * rest[3]
        skeleton.GetRestTransformsAttr().Set(Vt.Matrix4dArray(rest))

    whole = small_shot(tmp_path / "whole.usda")
    model = model_for(read_rigged_hair(whole))
    bake_rig(whole, tmp_path / "whole_out.usda", model)
    out = bake_rig(edited(change), tmp_path / "out.usda", model).path
    baked, own = Usd.Stage.Open(str(out)), Usd.Stage.Open(str(whole))
    animation = UsdSkel.Animation(baked.GetPrimAtPath("/Who/Rig/NeuralocksHair"))
    hair = [f"hips/head/{'/'.join(f'hair_{i}' for i in range(n + 1))}" for n in range(3)]
    assert list(animation.GetJointsAttr().Get()) == [*listed, *hair]
    assert list(animation.GetScalesAttr().Get())[3:] == [Gf.Vec3h(1), Gf.Vec3h(1, 2, 1), Gf.Vec3h(1)]
    places = own.GetAttributeAtPath("/Who/Motion.translations").Get()
    assert np.abs(np.array(animation.GetTranslationsAttr().Get())[3:] - np.array(places)[2:5]).max() < 1e-6
    turns = np.array([rotations(animation, code)[3:] for code in (7, 20)])
    assert np.abs(turns - hair_turns(tmp_path / "whole_out.usda", [7, 20])).max() < 1e-6
