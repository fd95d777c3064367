# SPDX-License-Identifier: Apache-2.0
"""What a clip is made of: the animation's samples, and what stands before and after them."""

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdSkel

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models.runtime import StrandModel
from usd.shot.stage import read_shot
from usd.skel.joints import JointSource

from ..shots import Recipe, write_shot


def test_a_pose_is_held_to_the_end_of_the_shot_where_the_animation_begins_before_it(tmp_path):
    """Animation with a run-up, whose exporter left out the samples after the character stopped."""
    path = write_shot(tmp_path, Recipe(frames=9))
    stage = Usd.Stage.Open(str(path))
    stage.SetStartTimeCode(4)
    stage.SetEndTimeCode(30)
    stage.GetRootLayer().Save()
    rig = read_shot(path).rigs[0]
    assert (rig.time_codes[0], rig.time_codes[-1]) == (1, 30)
    np.testing.assert_array_equal(rig.clip.joints[-1], rig.joints_at(9))


def test_a_pose_that_is_held_for_long_is_computed_once(tmp_path, monkeypatch):
    """A range of hundreds of frames around a short animation, in which the character's place still moves."""
    path = write_shot(tmp_path, Recipe(frames=9))
    stage = Usd.Stage.Open(str(path))
    stage.SetStartTimeCode(-300)
    stage.SetEndTimeCode(400)
    place = UsdGeom.Xformable(stage.GetDefaultPrim()).AddTranslateOp(opSuffix="late")
    for code in (12, 20):
        place.Set((0.1 * code, 0, 0), code)
    stage.Save()
    read, local = [], JointSource.local

    def counted(source, codes):
        read.append(len(codes))
        return local(source, codes)

    monkeypatch.setattr(JointSource, "local", counted)
    rig = read_shot(path).rigs[0]
    assert len(rig.time_codes) == 701 and sum(read) < 50
    for row, code in enumerate(rig.time_codes):
        if code in (-300, 0, 1, 4, 9, 10, 12, 15, 20, 21, 400):
            np.testing.assert_array_equal(rig.clip.joints[row], rig.joints_at(code))
            one = rig.joints.placement.at(code) @ local(rig.joints, [code])[0, 0]
            np.testing.assert_array_equal(rig.joints.posed([code])[0, 0], one)


@pytest.mark.parametrize("rate", [24.0, 60.0, 1000.0])
def test_a_range_that_begins_a_frame_before_the_samples_is_no_stand(tmp_path, rate):
    """The character begins at its own speed; only held for 0.1 s does it stand."""
    path = write_shot(tmp_path, Recipe(rate=rate, frames=9))
    stage = Usd.Stage.Open(str(path))
    stage.SetFramesPerSecond(24)  # the last one counts milliseconds

    def read(hold):
        stage.SetStartTimeCode(1 - hold * rate)
        stage.Save()
        rig = read_shot(path).rigs[0]
        return rig, StrandModel.load().sampler(rig.character, rig.clip).vectors(rig.border.seconds([-3, 1, 3, 9]))

    (rig, plain), (wider, same), (standing, other) = (read(hold) for hold in (0, 0.09, 0.1))
    np.testing.assert_array_equal(wider.time_codes, rig.time_codes)
    np.testing.assert_array_equal(same, plain)
    np.testing.assert_allclose(standing.time_codes[[0, -1]], [1 - 0.1 * rate, 9])
    assert np.abs(other - plain).max() > 0.1


def test_a_hold_that_was_left_out_is_found(tmp_path):
    """Blender 5 leaves out samples in which nothing changes: only the default value and the range of its own layer tell that a
    character stands for a frame. A shot that begins earlier, and scales that never change, tell nothing.
    """
    path = write_shot(tmp_path, Recipe(frames=9), "motion")
    stage = Usd.Stage.Open(str(path))
    animation = next(UsdSkel.Animation(p) for p in stage.Traverse() if p.IsA(UsdSkel.Animation))
    moving = [animation.GetTranslationsAttr(), animation.GetRotationsAttr()]
    firsts = [channel.Get(1.0) for channel in moving]
    shot = tmp_path / "shot.usda"
    shot.write_text(
        "#usda 1.0\n(\n  metersPerUnit = 1\n  startTimeCode = -1\n  endTimeCode = 9\n  timeCodesPerSecond = 24\n"
        "  subLayers = [@./motion.usda@]\n)\n"
    )

    def first_codes() -> list[float]:
        stage.Save()
        return [float(read_shot(each).rigs[0].time_codes[0]) for each in (path, shot)]

    scales = animation.GetScalesAttr()
    for code in (1, 2):
        scales.Set(scales.Get(), code)
    stage.SetStartTimeCode(0)
    assert first_codes() == [1, 1]
    for channel, first in zip(moving, firsts, strict=True):
        channel.Set(first)
    assert first_codes() == [0, 0]
    stage.SetStartTimeCode(1)
    assert first_codes() == [1, 1], "a range of the shot's own"
    stage.SetStartTimeCode(0)
    moving[1].Set(moving[1].Get(5.0))
    assert first_codes() == [1, 1], "another default value"


def test_keys_of_what_stands_still_are_no_motion(tmp_path):
    """A parent or scales with the same value at all their keys, some before the motion and between its samples: otherwise the
    character would stand, and start with a blow. Later keys hold it, as without them.
    """
    path = write_shot(tmp_path, Recipe(frames=9))

    def read():
        rig = read_shot(path).rigs[0]
        times = rig.border.seconds([1, 3, 5, 9, 12])
        return rig, StrandModel.load().sampler(rig.character, rig.clip).vectors(times)

    plain, wanted = read()
    stage = Usd.Stage.Open(str(path))
    animation = next(UsdSkel.Animation(p) for p in stage.Traverse() if p.IsA(UsdSkel.Animation))
    scales, turn = animation.GetScalesAttr(), UsdGeom.Xformable(stage.GetDefaultPrim()).AddTranslateOp(opSuffix="keyed")
    bind = scales.Get(1.0)
    scales.Clear()
    for code in (-20, -4, 2.5, 6.5):
        scales.Set(bind, code)
    for code in (-50, 3.5):
        turn.Set((0, 0, 0), code)
    stage.Save()
    keyed, vectors = read()
    np.testing.assert_array_equal(keyed.time_codes, plain.time_codes)
    np.testing.assert_allclose(vectors, wanted, atol=1e-5)
    scales.Set(bind, 30)
    stage.Save()
    assert read()[0].time_codes[-1] == 30


def with_a_face(path, codes):
    """The shot with a face weight at these time codes."""
    stage = Usd.Stage.Open(str(path))
    animation = next(UsdSkel.Animation(p) for p in stage.Traverse() if p.IsA(UsdSkel.Animation))
    animation.CreateBlendShapesAttr(["smile"])
    for code in codes:
        animation.CreateBlendShapeWeightsAttr().Set([0.5 + 0.5 * float(np.sin(code))], float(code))
    stage.GetRootLayer().Export(str(path.with_name("face.usda")))
    return path.with_name("face.usda")


def test_finer_keys_of_a_face_or_a_parent_are_no_poses_of_the_body(tmp_path):
    """In between, the body has no keys: a cut would be two fast steps, and each chord a motion of its own."""
    path = write_shot(tmp_path, Recipe(frames=40))
    stage = Usd.Stage.Open(str(path))
    animation = next(UsdSkel.Animation(p) for p in stage.Traverse() if p.IsA(UsdSkel.Animation))
    places = animation.GetTranslationsAttr()
    for code in range(20, 41):
        there = np.array(places.Get(code))
        there[0, 0] += 1
        places.Set(there, code)
    stage.Save()
    plain = read_shot(path).rigs[0]
    assert [plain.time_codes[1 + i] for i in plain.clip.times.searchsorted(plain.clip.cuts) - 1] == [20]
    for codes in (np.arange(1, 40.1, 0.5), np.arange(0, 41, 0.4)):
        rig = read_shot(with_a_face(path, codes)).rigs[0]
        np.testing.assert_array_equal(rig.time_codes[rig.time_codes <= 40], plain.time_codes)
        np.testing.assert_array_equal(rig.clip.cuts, plain.clip.cuts)
    animation.GetBlendShapeWeightsAttr().Clear()
    drift = UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddTranslateOp()
    for code in np.arange(1, 40.1, 0.25):
        drift.Set((0.002 * code, 0, 0), code)
    stage.Save()
    np.testing.assert_array_equal(read_shot(path).rigs[0].time_codes, plain.time_codes)


def test_keys_of_a_face_count_where_the_body_has_none(tmp_path):
    path = write_shot(tmp_path, Recipe(frames=9))
    codes = read_shot(with_a_face(path, [-10.5, 0.5, 4.5, 30.5])).rigs[0].time_codes
    assert codes[0] == -10.5 and codes[-1] == 30.5 and not {0.5, 4.5} & set(codes)
    stage = Usd.Stage.Open(str(path))
    animation = next(UsdSkel.Animation(p) for p in stage.Traverse() if p.IsA(UsdSkel.Animation))
    for attribute in (animation.GetTranslationsAttr(), animation.GetRotationsAttr(), animation.GetScalesAttr()):
        value = attribute.Get(1.0)
        attribute.Clear()
        attribute.Set(value)
    stage.Save()
    assert {4.5, 5.25} <= set(read_shot(with_a_face(path, [4.5, 5.25])).rigs[0].time_codes)


def stepped(folder, samples, step=13.0, end=40):
    """A shot in which the head turns about +Y in no time at `step`, sampled at these time codes."""
    path = write_shot(folder, Recipe(frames=40), name=f"{len(samples)}")
    stage = Usd.Stage.Open(str(path))
    stage.SetEndTimeCode(end)
    animation = next(UsdSkel.Animation(p) for p in stage.Traverse() if p.IsA(UsdSkel.Animation))
    for attribute in (animation.GetRotationsAttr(), animation.GetTranslationsAttr(), animation.GetScalesAttr()):
        bind = attribute.Get(1.0)
        attribute.Clear()
        attribute.Set(bind)
    rotations = animation.GetRotationsAttr()
    rest = list(rotations.Get())
    rotations.Clear()
    for code in samples:
        turn = 0.5 * (code >= step)
        turned = list(rest)
        turned[3] = rest[3] * Gf.Quatf(float(np.cos(turn / 2)), 0, float(np.sin(turn / 2)), 0)
        rotations.Set(turned, code)
    stage.Save()
    return read_shot(path).rigs[0]


@pytest.mark.parametrize("step", [13.0, 13.004, 12.8])
@pytest.mark.parametrize("apart", [0.2, 0.01, 0.001])
def test_a_pair_of_samples_that_makes_a_step_is_felt_as_a_sample_a_frame_is(tmp_path, step, apart):
    """As held keys are written. A spline through both would also fling hair before the step."""
    held = stepped(tmp_path, [1, step - apart, step, 40], step)
    dense = stepped(tmp_path, range(1, 41), 13.0)
    sampler = {
        name: StrandModel.load().sampler(rig.character, rig.clip) for name, rig in (("held", held), ("dense", dense))
    }
    codes = [5, 9, 11, 12, 14, 16, 20, 30, 40]
    is_, ought = (each.vectors(held.border.seconds(codes)) for each in sampler.values())
    most = np.abs(ought - ought[0]).max()
    assert np.abs(is_ - ought).max() < (0.01 if step == 13.0 else 0.5) * most
    assert np.abs(is_[:2] - is_[0]).max() < 0.05 * most
    # What is drawn stays as it is.
    assert np.allclose(held.joints_at(step - apart), held.joints_at(1)) and not np.allclose(
        held.joints_at(step), held.joints_at(1)
    )


def test_a_shot_on_twos_keeps_a_sample_a_step(tmp_path):
    samples = np.sort([*np.arange(1, 40, 2), *(np.arange(3, 40, 2) - 1e-2)])
    rig = stepped(tmp_path, samples)
    assert not np.intersect1d(rig.time_codes, np.arange(3, 40, 2) - 1e-2).size
    assert np.isin(np.arange(1, 40, 2), rig.time_codes).all()


@pytest.mark.parametrize("end", [40, 1.15], ids=["ten a frame", "part of a frame"])
def test_motion_that_is_sampled_finely_keeps_its_samples(tmp_path, end):
    samples = np.arange(1, end + 1e-6, 0.1 if end == 40 else 0.05)
    assert np.isin(samples, stepped(tmp_path, samples, end=end).time_codes).all()


def test_pairs_of_samples_that_are_near_the_next_ones_are_no_steps(tmp_path):
    samples = np.sort([*np.arange(1, 40, 0.6), *np.arange(1.2, 40, 0.6)])
    assert np.isin(samples, stepped(tmp_path, samples).time_codes).all()


def test_more_samples_than_can_be_held_are_read_once_a_frame(tmp_path, monkeypatch):
    """A take with motion blur, of which only whole frames fit in memory; a span of too many frames is refused as before."""
    path = write_shot(tmp_path, Recipe(frames=9))
    stage = Usd.Stage.Open(str(path))
    animation = next(UsdSkel.Animation(p) for p in stage.Traverse() if p.IsA(UsdSkel.Animation))
    turns = animation.GetRotationsAttr()
    for code in np.arange(1, 9, 0.125):
        turns.Set(turns.Get(float(code)), float(code))
    stage.Save()
    every = read_shot(path).rigs[0]
    joints = len(every.joints.names)
    monkeypatch.setattr("usd.skel.clip_codes.LARGEST_CLIP", 12 * joints)
    rig = read_shot(path).rigs[0]
    np.testing.assert_array_equal(rig.time_codes, np.arange(1, 10))
    np.testing.assert_array_equal(rig.clip.joints, every.clip.joints[np.isin(every.time_codes, rig.time_codes)])
    (note,) = [note for note in rig.notes if "too many to hold" in note]
    assert note.endswith(
        f"its animation has 65 samples of {joints} joints, too many to hold in memory; it is read once per frame"
    )
    assert not any("too many" in note for note in every.notes)
    monkeypatch.setattr("usd.skel.clip_codes.LARGEST_CLIP", 8 * joints)
    with pytest.raises(NeuralocksError, match="spans time codes 1 to 9, too many samples to hold"):
        read_shot(path)
