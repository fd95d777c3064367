# SPDX-License-Identifier: Apache-2.0
"""Rollouts cut from motion that a user gives: hair feels what the network reads of it."""

from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.animation.gestures import KINDS
from neuralocks_core.animation.random_motion import scripted_clip
from neuralocks_core.boundary.smooth_motion import SmoothMotion
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.metrics import motion_error
from neuralocks_core.motion import Clip

pytest.importorskip("torch", reason="the extra 'train' is not installed")
pytest.importorskip("warp", reason="the extra 'train' is not installed")
from neuralocks_core.training.data.rollouts import PREROLL, RolloutMaker


def captured_of(scene, clip, count):
    """The first rollouts that are cut from a clip."""
    maker = RolloutMaker(replace(scene, clips=(clip,)))
    wanted = [i for i in range(40) if maker.draw(i).first == PREROLL][:count]
    assert len(wanted) == count
    return [maker.make(i) for i in wanted]


def test_no_rollout_reaches_across_a_cut_of_its_motion(scene):
    walk = scripted_clip(scene.character, "walk", 8.0)
    joints = walk.joints.copy()
    joints[walk.times >= 4.0, :, 0, 3] += 3.0
    length = np.linalg.norm(np.diff(scene.grooms[0].rest[0], axis=0), axis=-1).sum()
    for rollout in captured_of(scene, replace(walk, joints=joints, cuts=[4.0]), 6):
        steps = np.diff(rollout.moved[rollout.first :] * rollout.step, axis=0)
        assert np.linalg.norm(steps, axis=-1).max() < 0.2 * length


def test_rollouts_that_end_before_they_can_be_learned_from_are_refused(scene):
    clips = (scripted_clip(scene.character, "walk", 8.0),)
    with pytest.raises(NeuralocksError, match=f"^frames: {PREROLL + 1} are too few .* at least {PREROLL + 2}"):
        replace(scene, clips=clips, frames=PREROLL + 1)
    shortest = RolloutMaker(replace(scene, clips=clips, frames=PREROLL + 2))
    assert all(len(draw.times) - draw.first >= 2 for draw in map(shortest.draw, range(20)))
    with pytest.raises(NeuralocksError, match="^frames: 2 are too few"):
        replace(scene, frames=2)


@pytest.mark.parametrize("rate, held", [(24, 1), (24, 2)])
def test_hair_is_simulated_on_the_motion_that_the_network_reads(scene, rate, held):
    """Between the samples of a file, and through poses that it holds, as in a bake."""
    fine = scripted_clip(scene.character, "walk", 8.0, 120.0)
    few = fine.times[:: 120 // rate]
    given = Clip(few, fine.at(few[np.arange(len(few)) // held * held]))
    smooth = Clip(fine.times, SmoothMotion(scene.character, Clip(few[::held], given.joints[::held])).at(fine.times))
    for rollout, true in zip(captured_of(scene, given, 2), captured_of(scene, smooth, 2), strict=True):
        moved, wanted = (each.moved[each.first :] * each.step for each in (rollout, true))
        assert np.abs(rollout.vectors - true.vectors)[:, scene.spec.slices["pose"]].max() < 1e-3
        lengths = np.linalg.norm(np.diff(true.rest, axis=1), axis=-1).sum(axis=1)
        assert motion_error(moved, wanted, lengths)["median"] < 0.01


def test_made_up_motion_has_the_gestures_wanted_and_stops(scene, monkeypatch):
    """Walks, of which few end in time to stand still for the last fifth; all do if all stop midway."""
    maker = RolloutMaker(replace(scene, frames=110, gestures={kind: float(kind == "walk") for kind in KINDS}))
    standing = []
    for share in (0.0, 1.0):
        monkeypatch.setattr("neuralocks_core.training.data.rollouts.STOPS", share)
        clips = [maker.draw(i).clip for i in range(10)]
        gone = [np.linalg.norm(np.ptp(clip.joints[:, 0, :3, 3], axis=0)) for clip in clips]
        assert min(gone) > 0.3
        standing.append(sum(bool(np.ptp(clip.joints[-20:], axis=0).max() < 1e-9) for clip in clips))
    assert standing[0] < 5 and standing[1] == 10
