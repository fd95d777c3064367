# SPDX-License-Identifier: Apache-2.0
"""What commands for mesh hair tell of rigs that would be baked otherwise than somebody expects."""

import re

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig.network import RigSampler
from usd.assets.importing import import_groom
from usd.review.inspect import inspect
from usd.rig.bake import bake_rig
from usd.rig.notes import rigged_notes
from usd.rig.stage import check_patterns, read_rigged_hair

from ..rig_shots import EXAMPLE, model_for, small_shot


def _retyped(name: str, kind, value):
    """A change that gives a channel of the animation another type with the same numbers."""

    def change(stage):
        prim = stage.GetPrimAtPath("/Who/Motion")
        old = prim.GetAttribute(name)
        samples, array = {code: old.Get(code) for code in old.GetTimeSamples()}, type(kind.defaultValue)
        still = old.Get()
        prim.RemoveProperty(name)
        layer = stage.GetRootLayer()
        spec = Sdf.AttributeSpec(
            layer.GetPrimAtPath(prim.GetPath()), name, kind
        )  # a stage would take the schema's type
        for code, values in samples.items():
            layer.SetTimeSample(spec.path, code, array([value(one) for one in values]))
        if not samples:
            spec.default = array([value(one) for one in still])

    return change


@pytest.mark.parametrize(
    ("name", "kind", "value"),
    [
        ("rotations", Sdf.ValueTypeNames.QuathArray, Gf.Quath),
        ("translations", Sdf.ValueTypeNames.Double3Array, Gf.Vec3d),
        ("scales", Sdf.ValueTypeNames.Float3Array, lambda v: Gf.Vec3f(*map(float, v))),
    ],
)
def test_channels_of_another_type_are_those_that_usd_ignores(edited, tmp_path, name, kind, value):
    """If they were read all the same, the body would begin to move in the bake."""
    model = model_for(read_rigged_hair(small_shot(tmp_path / "plain.usda")))
    shot = edited(_retyped(name, kind, value))
    with pytest.raises(NeuralocksError, match=f"/Who/Motion: its {name} are .*UsdSkel ignores the animation; author "):
        bake_rig(shot, tmp_path / "out.usda", model)
    stage = Usd.Stage.Open(str(shot))
    query = UsdSkel.Cache().GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath("/Who/Rig")))
    posed = [np.array(query.ComputeJointLocalTransforms(code)) for code in (1, 7)]
    assert np.array_equal(*posed), "USD shows motion"


def test_rotations_that_stretch_are_told(edited):
    """UsdSkel takes quaternions as they come."""

    def change(stage):
        rotations = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion")).GetRotationsAttr()
        for code in rotations.GetTimeSamples():
            rotations.Set(Vt.QuatfArray([q * 1.5 for q in rotations.Get(code)]), code)

    notes = rigged_notes(read_rigged_hair(edited(change)).stage_rig)
    assert sum("joint 'hips' at time code 1 is not of unit length" in note for note in notes) == 1


def test_a_neck_without_its_name_can_be_named(edited, tmp_path):
    """The network reads the neck: which joint that is changes the hair, so there is a note if it was not found."""

    def change(stage):
        skeleton, motion = UsdSkel.Skeleton(stage.GetPrimAtPath("/Who/Rig")), stage.GetPrimAtPath("/Who/Motion")
        names = [name.replace("hips/head", "hips/b02/head") for name in skeleton.GetJointsAttr().Get()]
        names.insert(1, "hips/b02")
        skeleton.GetJointsAttr().Set(names)
        for attribute in (skeleton.GetBindTransformsAttr(), skeleton.GetRestTransformsAttr()):
            values = list(attribute.Get())
            attribute.Set([values[0], values[0] if "bind" in attribute.GetName() else type(values[0])(1), *values[1:]])
        mesh = UsdSkel.BindingAPI(stage.GetPrimAtPath("/Who/Hair")).GetJointIndicesPrimvar()
        mesh.Set([index + 1 for index in mesh.Get()])
        motion.GetAttribute("joints").Set([name for name in names if name != "hips/b02"])

    shot = edited(change)
    hair = read_rigged_hair(shot)
    assert any("no joint found for neck" in note for note in rigged_notes(hair.stage_rig))
    model = model_for(hair)
    named = bake_rig(shot, tmp_path / "named.usda", model, joints={"neck": "b02"})
    assert not any("no joint found for neck" in note for note in named.notes)
    with pytest.raises(NeuralocksError, match="b03"):
        bake_rig(shot, tmp_path / "out.usda", model, joints={"neck": "b03"})


@pytest.mark.parametrize(("letters", "told"), [(21, False), (22, True)])
def test_a_name_that_blender_cuts_is_told(edited, tmp_path, letters, told):
    """Blender counts bytes, and each of these letters has three."""

    def change(stage):
        for prim in ("Rig", "Motion"):
            joints = stage.GetPrimAtPath(f"/Who/{prim}").GetAttribute("joints")
            joints.Set([name.replace("hair_3", letters * "髪") for name in joints.Get()])

    shot = edited(change)
    notes = bake_rig(shot, tmp_path / "hair.usda", model_for(read_rigged_hair(shot))).notes
    assert any("more than 63 bytes" in note for note in notes) == told


def test_a_strength_that_a_model_of_held_poses_does_not_have_is_told(tmp_path):
    shot = small_shot(tmp_path / "shot.usda")
    for dynamic, strength, told in ((False, 0.5, True), (False, 1, False), (True, 0.5, False)):
        model = model_for(read_rigged_hair(shot), dynamic)
        notes = bake_rig(shot, tmp_path / "hair.usda", model, strength=strength).notes
        assert any(note.startswith("motion strength: ") for note in notes) == told


def test_a_pattern_that_stands_for_nothing_is_refused(tmp_path):
    hair = read_rigged_hair(small_shot(tmp_path / "shot.usda"), chains=["hair_*", "tuft_*"])
    with pytest.raises(NeuralocksError, match=r"--chains tuft_\*: no joint of the hair has such a name"):
        check_patterns(hair, ["hair_*", "tuft_*"])


def test_what_is_wrong_with_a_rig_is_told_by_its_own_commands(tmp_path):
    """As `inspect` reports it; joints that no bone model reads are left out."""
    shot = small_shot(tmp_path / "shot.usda", scale=100.0)
    told = inspect(shot)["spoils"]
    assert not any("shoulder" in note for note in told)
    assert set(rigged_notes(read_rigged_hair(shot).stage_rig)) <= set(told)


def test_features_that_do_not_fit_are_refused(tmp_path):
    hair = read_rigged_hair(small_shot(tmp_path / "shot.usda"))
    model = model_for(hair)
    with pytest.raises(NeuralocksError, match="reads 15 numbers"):
        model.evaluate(np.zeros((2, 3, 15)))
    assert np.isfinite(model.evaluate(np.full(15, 1e300))).all()
    sampler = RigSampler(model.spec, hair.stage_rig.character, hair.stage_rig.clip)
    for times, fact in (([0.0, np.nan], "hold NaN"), ([[0.5, 1.0]], r"are of shape \(1, 2\)")):
        with pytest.raises(NeuralocksError, match=f"times: {fact}"):
            sampler.features(times)
    assert model.evaluate(sampler.features([])).shape == (0, len(model.chains), 4)


@pytest.mark.parametrize(
    ("ending", "how"),
    [
        ("fbx", "import it into Blender and export USD there$"),
        ("vrm", r"import it into Blender and export USD there .*vrm_to_usd.py in the source does\)$"),
        ("glb", "import it into Blender .*vrm_to_usd"),
        ("abc", "import it into Blender and export USD there$"),
        ("blend", "open it in Blender and export USD there$"),
    ],
)
def test_a_character_in_another_format_is_told_the_way_to_usd(tmp_path, ending, how):
    path = tmp_path / f"who.{ending}"
    path.write_bytes(b"anything")
    for use in (read_rigged_hair, inspect, lambda path: import_groom(path, tmp_path / "groom.usda")):
        with pytest.raises(NeuralocksError, match=f"who.{ending}: not a readable USD file .*; {how}"):
            use(path)


@pytest.mark.parametrize(("joint", "name"), [(3, "hair_1"), (2, "hair_0")])
def test_hair_that_the_animation_mirrors_is_told(edited, tmp_path, joint, name):
    """By a joint of its own, or by the one that carries it."""
    model = model_for(read_rigged_hair(small_shot(tmp_path / "plain.usda"), chains=["hair_1"]))

    def mirror(stage):
        scales = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion")).GetScalesAttr()
        values = list(scales.Get(1.0))
        values[joint] = Gf.Vec3h(-1, 1, 1)
        scales.Set(values, 1.0)

    shot = edited(mirror)
    said = f"hair joint '{name}' is mirrored by its animation"
    assert any(said in note for note in bake_rig(shot, tmp_path / "out.usda", model).notes)
    assert any(said in note for note in inspect(shot)["spoils"])


@pytest.mark.parametrize("dynamic", [True, False])
def test_a_joint_that_a_scale_of_zero_hides_for_some_frames_is_named(edited, tmp_path, dynamic):
    """By a bake, and by `inspect` before it; joints that are not read get no message."""

    def hide(stage, joint):
        motion = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion"))
        names = list(motion.GetJointsAttr().Get())
        for code in (3, 4, 5):
            scales = [Gf.Vec3h(0 if name == names[joint] and code == 4 else 1) for name in names]
            motion.GetScalesAttr().Set(scales, code)

    model = model_for(read_rigged_hair(small_shot(tmp_path / "whole.usda")), dynamic=dynamic)
    path = edited(lambda stage: hide(stage, 1))
    said = "/Who/Rig: joint 'hips/head' has zero scale at time code 4; .* 0.0001 hides"
    with pytest.raises(NeuralocksError, match=said):
        bake_rig(path, tmp_path / "out.usda", model)
    assert re.search(said, "\n".join(inspect(path)["stops"]))
    path = edited(lambda stage: hide(stage, 4))
    assert bake_rig(path, tmp_path / "out.usda", model).rigs[0].samples and not inspect(path)["stops"]


@pytest.mark.parametrize(("joints", "told"), [({}, 0), ({"upper_chest": "spine_01"}, 1)])
def test_another_joint_in_place_of_the_one_that_a_model_read_is_told(tmp_path, joints, told):
    """The shipped model was trained for this rig, in which both are."""
    result = bake_rig(EXAMPLE / "shot.usda", tmp_path / "baked.usda", joints=joints, frames="1:3")
    said = [note for note in result.notes if "is read as" in note]
    assert len(said) == told
    if told:
        assert "'spine_01' is read as upper_chest, but in training 'spine_03' was" in said[0]
        assert said[0].endswith("check --joint upper_chest=spine_03")
