# SPDX-License-Identifier: Apache-2.0
"""Training on rollouts: repeatable material, hair that learns to move, runs that survive a kill."""

from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.anatomy.humanoid import Humanoid
from neuralocks_core.animation.random_motion import scripted_clip
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.measures import body_measures
from neuralocks_core.models import model_file
from tests.core.rigs import person

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")
pytest.importorskip("warp", reason="the extra 'train' is not installed")
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.deformation.strand_session import StrandSession
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.training import checkpoint
from neuralocks_core.training.data.farm import load, save
from neuralocks_core.training.data.rollouts import RolloutMaker, held_out_split, kept_from_training
from neuralocks_core.training.learning import methods
from neuralocks_core.training.learning.moment_options import SelfSupervisedOptions
from neuralocks_core.training.learning.regression_options import RegressionOptions
from neuralocks_core.training.train import train_strands
from neuralocks_core.training.work_folder import claimed


def test_a_rollout_depends_on_its_number_alone(scene, tmp_path):
    one, two = RolloutMaker(scene).make(3), RolloutMaker(scene).make(3)
    save(tmp_path / "r.npz", two)
    two = load(tmp_path / "r.npz")
    for name, value in vars(one).items():
        assert np.array_equal(value, getattr(two, name)), name
    assert not np.array_equal(one.vectors, RolloutMaker(scene).make(4).vectors)


def test_strands_that_share_their_roots_are_all_drawn(scene, monkeypatch):
    """As of locks that are modelled as bundles: more strands than are drawn around one have the very same root."""

    class Impatient(np.random.Generator):
        left = 5000

        def integers(self, *args, **kwargs):
            self.left -= 1
            assert self.left, "it draws the same strands again and again"
            return super().integers(*args, **kwargs)

    monkeypatch.setattr("numpy.random.default_rng", lambda seed: Impatient(np.random.PCG64(seed)))
    hair = scene.grooms[0]
    rest = hair.rest - hair.rest[:, :1] + hair.rest[hair.lock == 0][0, 0]
    bundle = replace(hair, rest=rest, lock=np.zeros_like(hair.lock)).subset(np.arange(20))
    assert RolloutMaker(replace(scene, grooms=(bundle,))).draw(0).strands.tolist() == list(range(20))


def test_rollouts_start_at_rest_and_move(scene):
    rollout = RolloutMaker(scene).make(5)
    moved = rollout.moved * rollout.step
    assert np.abs(moved[3] - moved[0]).max() < 1e-3
    assert np.abs(rollout.vectors[0, scene.spec.slices["history"]]).max() < 1e-6
    assert np.abs(moved - moved[0]).max() > 1e-2


def test_another_history_reads_the_same_simulation(scene):
    maker = RolloutMaker(scene)
    rollout = maker.make(6)
    assert np.array_equal(maker.reread(6, rollout, scene.spec).vectors, rollout.vectors)
    spec = BoundarySpec(bins=(1,) * 30)
    again = maker.reread(6, rollout, spec)
    assert again.vectors.shape == (60, spec.size) and again.bind.shape == (spec.size,)


def test_a_groom_that_cannot_be_learned_from_is_refused_before_anything_is_simulated(scene, in_one_process, tmp_path):
    hair = scene.grooms[0]
    bare = replace(hair, valid=np.zeros_like(hair.valid))
    for grooms, fact in (((hair, bare), "number 1 has no strand"), ((), "there is none")):
        with pytest.raises(NeuralocksError, match=f"^grooms: {fact}"):
            train_strands(replace(scene, grooms=grooms), tmp_path / "hair.neuralocks", RegressionOptions(steps=2))
    assert not any(tmp_path.iterdir())


def test_held_out_strands_are_never_trained_on(scene):
    groom = scene.grooms[0]
    assert not set(held_out_split(groom, True)) & set(held_out_split(groom, False))
    assert len(held_out_split(groom, True)) == kept_from_training(groom) > 0
    half = replace(groom, valid=groom.valid & (np.arange(len(groom.rest)) % 2 == 0))
    for out in (True, False):
        assert np.array_equal(held_out_split(half, out), [i for i in held_out_split(groom, out) if i % 2 == 0])
    few = replace(groom, lock=groom.lock % 7)
    assert np.array_equal(held_out_split(few, True), held_out_split(few, False)) and kept_from_training(few) == 0


def test_held_out_motion_is_never_trained_on(scene):
    """Training cuts from all of each clip, however often; what is held out is made up."""
    clips = tuple(scripted_clip(scene.character, kind, 8.0) for kind in ("walk", "nod"))
    given = replace(scene, clips=clips)
    taken = [
        [maker.draw(i).clip.times[-1] for i in range(20)]
        for maker in map(RolloutMaker, (given, replace(given, held_out=True)))
    ]
    lengths = {float(clip.times[-1]) for clip in clips}
    assert lengths & set(map(float, taken[0])) and not lengths & set(map(float, taken[1]))


def test_a_run_of_so_many_steps_is_the_same_however_fast_its_simulations_come(
    scene, few, in_one_process, tmp_path, monkeypatch
):
    """With a budget in seconds, each step learns from what happens to be there."""
    monkeypatch.setattr("neuralocks_core.training.learning.methods.STEPS_EACH", 2)
    graphs = []
    for name, ready in (("early", 6), ("late", 0)):
        out = tmp_path / f"{name}.neuralocks"
        folder = tmp_path / f"{name}.neuralocks.training/rollouts"
        folder.mkdir(parents=True)
        for index in range(ready):
            save(folder / f"{index:06d}.npz", RolloutMaker(scene).make(index))
        monkeypatch.setattr("neuralocks_core.training.train.discard", lambda work: None)
        train_strands(scene, out, RegressionOptions(steps=6, clips=4, strands=4), rollouts=6)
        graphs.append(model_file.read(out).graphs)
        assert model_file.read(out).meta["training"]["rollouts"] == 6
    assert graphs[0] == graphs[1]


def test_hair_learns_to_move_in_a_minute(scene, in_one_process, tmp_path, monkeypatch):
    """On motion and strands that it never saw, the network errs clearly less than hair carried rigidly. With so little to learn from,
    Muon, the default, would take most of the time.
    """
    monkeypatch.setattr("neuralocks_core.training.train.HELD_OUT", 4)
    messages = []
    options = RegressionOptions(steps=350, clips=8, strands=6, rate=6e-3, optimiser="adamw", seed=2)
    path = train_strands(
        scene, tmp_path / "hair.neuralocks", options, rollouts=20, progress=lambda *a: messages.append(a)
    )
    report = model_file.read(path).meta["report"]["held out"]
    assert report["motion"] < 0.62
    assert 0.5 < report["motion_ratio"] < 1.3
    assert report["position"] < 0.6 * report["rigid"]
    assert not (tmp_path / "hair.neuralocks.training").exists()
    assert messages[-1][0] == 1000
    assert "motion error" in messages[-1][2]
    sampler = StrandModel.load(path).sampler(person(), scripted_clip(person(), "shake"))
    session = StrandSession(StrandModel.load(path), scene.grooms[0])
    session.anchor(sampler.held_bind())
    tips = np.stack([session.displacement(v)[:, -1] for v in sampler.vectors(np.arange(0, 2, 0.1))])
    assert np.ptp(tips, axis=0).max() > 0.03


def test_a_killed_run_goes_on(scene, few, tmp_path, monkeypatch):
    """Killed while the first simulations are made, and again after the first checkpoint."""
    out = tmp_path / "hair.neuralocks"
    work = tmp_path / "hair.neuralocks.training"
    short = RegressionOptions(steps=20, clips=4, strands=4)

    def kill_early(farm, count, say):
        wait(farm, 2, say)
        raise KeyboardInterrupt

    def kill_late(done, total, message):
        if "motion error" in message:
            raise KeyboardInterrupt

    def kept():
        return {path: path.stat().st_mtime_ns for path in [work / "codes.npz", *work.glob("*/*.npz")]}

    wait = methods.wait
    with monkeypatch.context() as first, pytest.raises(KeyboardInterrupt):
        first.setattr(methods, "wait", kill_early)
        train_strands(scene, out, short, rollouts=8)
    made = kept()
    assert not out.exists() and not (work / "checkpoint.npz").exists() and len(made) > 2
    with pytest.raises(KeyboardInterrupt):
        train_strands(scene, out, short, rollouts=8, resume=True, progress=kill_late)
    assert not out.exists() and (work / "checkpoint.npz").exists() and made.items() <= kept().items()
    train_strands(scene, out, short, rollouts=8, resume=True)
    assert model_file.read(out).meta["training"]["steps"] >= 20


def test_what_cannot_be_resumed_says_why(scene, tmp_path):
    with pytest.raises(NeuralocksError, match="no training to resume"):
        train_strands(scene, tmp_path / "x.neuralocks", resume=True)
    with pytest.raises(NeuralocksError, match="ends in .neuralocks"):
        train_strands(scene, tmp_path / "x.zip")
    path = tmp_path / "c.npz"
    checkpoint.save(path, {"step": 1}, {"net": torch.nn.Linear(2, 2)})
    assert checkpoint.load(path, {"net": torch.nn.Linear(2, 2)}) == {"step": 1}
    for broken in (torch.nn.Linear(3, 2), torch.nn.Identity()):
        with pytest.raises(NeuralocksError, match="does not fit"):
            checkpoint.load(path, {"net": broken})
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(NeuralocksError, match="does not fit"):
        checkpoint.load(path, {"net": torch.nn.Linear(2, 2)})


def test_a_training_that_runs_away_is_one_line(scene, few, in_one_process, tmp_path):
    """Steps far too large end in NaN, or in weights that no model file holds: never in a model, nor in a checkpoint."""
    out, options = tmp_path / "hair.neuralocks", RegressionOptions(steps=30, rate=1e12, clips=2, strands=2)
    with pytest.raises(NeuralocksError, match="--set rate") as caught:
        train_strands(scene, out, options, rollouts=2)
    assert "\n" not in str(caught.value) and not out.exists()
    with pytest.raises(NeuralocksError, match="--set rate"):
        train_strands(scene, out, options, rollouts=2, resume=True)


def test_a_training_is_resumed_as_it_was_begun_only(scene, few, in_one_process, tmp_path):
    """Weights of another output or method fit in shape: hair would be wrong, or the optimiser would break. Simulations belong to
    the strands and the motion that they were made from; two trainings in one folder would mix theirs.
    """
    out, tiny = tmp_path / "hair.neuralocks", {"clips": 2, "strands": 2}
    train_strands(scene, out, RegressionOptions(steps=2, **tiny), rollouts=4, keep_work=True)
    before = out.read_bytes()
    for name, value in {"output": "displacement", "static": True, "optimiser": "adamw", "motion": "linear"}.items():
        with pytest.raises(NeuralocksError, match=f"other settings in {name}"):
            train_strands(scene, out, RegressionOptions(steps=4, **tiny, **{name: value}), rollouts=4, resume=True)
    shorter = tuple(replace(groom, rest=0.9 * groom.rest) for groom in scene.grooms)
    joints = scene.character.humanoid.joints
    renamed = replace(scene.character, humanoid=Humanoid({**joints, "upper_chest": joints["hips"]}))
    skeleton = scene.character.skeleton
    hung = replace(scene.character, skeleton=replace(skeleton, parents=[*skeleton.parents[:-1], 0]))
    assert skeleton.parents[-1] != 0
    for other, fact in (
        (replace(scene, seed=7), f"began with --seed {scene.seed}; resume with that"),
        (replace(scene, character=renamed), "began with a different character"),
        (replace(scene, character=hung), "began with a different character"),
        (replace(scene, character=replace(scene.character, carrier=2)), "began with a different character"),
        (replace(scene, gestures={"bow": 3}), "began with a different gesture"),
        (replace(scene, grooms=shorter), "began with a different groom; resume with the same, or train without"),
    ):
        with pytest.raises(NeuralocksError, match=fact):
            train_strands(other, out, RegressionOptions(steps=4, **tiny), rollouts=4, resume=True)
    with (
        claimed(tmp_path / "hair.neuralocks.training"),
        pytest.raises(NeuralocksError, match="another training is running"),
    ):
        train_strands(scene, out, RegressionOptions(steps=4, **tiny), rollouts=4)
    assert out.read_bytes() == before
    train_strands(scene, out, RegressionOptions(steps=4, **tiny), rollouts=4, resume=True, keep_work=True)
    card = model_file.read(out).meta["training"]
    assert card["steps"] == 4 and "resumed with other options" not in card
    lowest, own, highest = card["measures"]["lowest"], body_measures(scene.character), card["measures"]["highest"]
    assert np.all(lowest <= own + 1e-4) and np.all(own <= np.add(highest, 1e-4))
    told = []
    other = RegressionOptions(steps=6, collision=9.0, **tiny)
    train_strands(scene, out, other, rollouts=4, resume=True, tell=told.extend)
    assert len(told) == 1 and "continues with other options than it began with: collision 9.0 after 45.0" in told[0]
    assert model_file.read(out).meta["training"]["resumed with other options"] == ["collision 9.0 after 45.0"]


@pytest.mark.parametrize(
    "options",
    (
        SelfSupervisedOptions(style=()),
        SelfSupervisedOptions(steps=0),
        SelfSupervisedOptions(output="x"),
        SelfSupervisedOptions(strands=0),
        SelfSupervisedOptions(poses=0),
        RegressionOptions(optimiser="sgd"),
        RegressionOptions(clips=10_000_000),
        RegressionOptions(rate=float("nan")),
    ),
)
def test_options_that_no_training_can_use_are_refused_at_once(scene, tmp_path, options):
    with pytest.raises(NeuralocksError, match="--s"):
        train_strands(scene, tmp_path / "x.neuralocks", options)
    assert not list(tmp_path.iterdir())
