# SPDX-License-Identifier: Apache-2.0
"""The folder beside a model in which its training works."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from neuralocks_core.animation.random_motion import scripted_clip
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.skinned_body import Body
from neuralocks_core.training import work_folder
from tests.core.rigs import HEAD, person, straight_hair

PARTS_OF_A_BODY = ("points", "triangles", "joint_indices", "joint_weights")


def _kept(out):
    """What a killed training leaves."""
    folder = work_folder.folder_beside(out)
    (folder / "rollouts").mkdir(parents=True)
    for name in ("lock", "inputs.json", "checkpoint.npz", "rollouts/000000.npz"):
        (folder / name).touch()
    return folder


def test_what_nobody_resumes_is_removed_and_nothing_else(tmp_path):
    """Not the model, not the folder of another running training, and not what somebody has put there."""
    out = tmp_path / "hair.neuralocks"
    out.touch()
    work_folder.abandon(out)
    folder = _kept(out)
    with work_folder.claimed(folder):
        work_folder.abandon(out)
        assert (folder / "rollouts/000000.npz").exists()
    work_folder.abandon(out)
    assert [path.name for path in tmp_path.iterdir()] == [out.name]
    folder = _kept(out)
    (folder / "notes.txt").touch()
    work_folder.abandon(out)
    assert [path.name for path in folder.iterdir()] == ["notes.txt"]


def test_a_name_is_reserved_once(tmp_path):
    """Until its holder releases it; not if there is a model, or a training that somebody may resume."""
    out, kept = tmp_path / "hair.neuralocks", tmp_path / "kept.neuralocks"
    assert work_folder.reserve(out) and not work_folder.reserve(out)
    work_folder.abandon(out)
    assert not list(tmp_path.iterdir())
    assert work_folder.reserve(out)
    with work_folder.claimed(work_folder.folder_beside(out)):  # its training
        assert not work_folder.reserve(out)
        out.touch()
    assert not work_folder.reserve(out) and [path.name for path in tmp_path.iterdir()] == [out.name]
    _kept(kept)
    assert not work_folder.reserve(kept)
    with pytest.raises(NeuralocksError, match="nowhere"):
        work_folder.reserve(tmp_path / "nowhere" / "hair.neuralocks")


@pytest.mark.parametrize("forged", ("[" * 100_000, "[]", '{"seed": 0}', "", "null"))
def test_notes_that_are_none_are_one_line(tmp_path, monkeypatch, forged):
    monkeypatch.setattr(work_folder, "_inputs", lambda scene: {"seed": 0, "groom": "a"})
    (tmp_path / work_folder.INPUTS).write_text(forged)
    with pytest.raises(NeuralocksError, match="inputs.json: cannot be read; train without --resume"):
        work_folder.keep_inputs(SimpleNamespace(), tmp_path, resume=True)


@pytest.mark.parametrize("name, now", [("integrator", "BDF2"), ("share of stops", 0.3), ("gesture", {"bow": 3.0})])
def test_simulations_made_otherwise_are_not_gone_on_with(tmp_path, monkeypatch, name, now):
    """Those of a release whose solver damped motion by its steps name no integrator, and those without stops no share of these."""
    monkeypatch.setattr(work_folder, "_inputs", lambda scene: {"seed": 0, name: now})
    (tmp_path / work_folder.INPUTS).write_text('{"seed": 0}')
    with pytest.raises(NeuralocksError, match=f"began with a different {name}; .*train without --resume"):
        work_folder.keep_inputs(SimpleNamespace(), tmp_path, resume=True)


def test_simulations_of_another_body_or_motion_are_not_gone_on_with(tmp_path):
    """Each part of it that a simulation is made from counts."""
    pytest.importorskip("warp", reason="the extra 'train' is not installed")
    from neuralocks_core.training.data.rollouts import TrainingScene

    points = np.random.default_rng(0).normal(size=(9, 3))
    body = Body(points, np.array([[0, 1, 2]]), np.full((9, 1), HEAD), np.ones((9, 1)), {"large": 0.1 * points})
    who, clip = Character(person().skeleton, body), scripted_clip(person(), "nod", 2.0)
    clip = replace(clip, shape=np.zeros((len(clip.times), 1)))
    scene = TrainingScene(who, (straight_hair(20),), (clip,))
    turned = replace(who.skeleton, bind=who.skeleton.bind * np.append(np.ones((4, 3)), np.full((4, 1), 1.01), axis=1))
    others = {
        "character": [
            *(Character(who.skeleton, replace(body, **{name: getattr(body, name) * 2})) for name in PARTS_OF_A_BODY),
            Character(who.skeleton, replace(body, shapes={"large": 0.2 * points})),
            Character(turned, body),
            Character(who.skeleton),
        ],
        "clips": [
            (),
            (replace(clip, times=clip.times * 1.01),),
            (replace(clip, joints=clip.joints[:, :, :, ::-1]),),
            (replace(clip, shape=clip.shape + 0.1),),
        ],
        "spec": [BoundarySpec(bins=(1,) * 8)],
        "grooms": [(straight_hair(20, seed=1),)],
    }
    work_folder.keep_inputs(scene, tmp_path, resume=False)
    facts = {"character": "character", "clips": "motion", "spec": "history", "grooms": "groom"}
    for name, values in others.items():
        for value in values:
            with pytest.raises(NeuralocksError, match=f"began with a different {facts[name]};"):
                work_folder.keep_inputs(replace(scene, **{name: value}), tmp_path, resume=True)
    work_folder.keep_inputs(scene, tmp_path, resume=True)


@pytest.mark.parametrize("learned_with", (work_folder.CODES, work_folder.BEGINNING))
def test_a_network_does_not_go_on_without_what_it_learned_with(tmp_path, learned_with):
    """New codes of the strands would mean something else to it, and the model would be silently wrong."""
    out = tmp_path / "hair.neuralocks"
    folder = _kept(out)
    with pytest.raises(NeuralocksError, match="lacks codes.npz, with which .*; train without --resume"):
        work_folder.beginning_of(folder, None, resume=True)
    (folder / learned_with).touch()
    kept = folder / learned_with if learned_with == work_folder.BEGINNING else None
    assert work_folder.beginning_of(folder, None, resume=True) == kept
