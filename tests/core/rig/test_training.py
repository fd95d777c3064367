# SPDX-License-Identifier: Apache-2.0
"""Energy, simulation and training of rigs: exact where it can be, better than rigid where it is learnt."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from neuralocks_core.progress import silent
from neuralocks_core.reference.chains import ChainSolver
from neuralocks_core.rig import find_chains, rig_spec
from neuralocks_core.rig.kinematics import bone_ends, half_turns, pose_chains, skin
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.rig.rods import RigMaterial, RodTree
from neuralocks_core.rotation import from_quaternion, from_vector
from neuralocks_core.training.rig import dynamic as rig_dynamic
from neuralocks_core.training.rig import report as rig_report
from neuralocks_core.training.rig.dynamic import train_dynamic
from neuralocks_core.training.rig.energy import RigEnergy, bounded_turns
from neuralocks_core.training.rig.motion import DEFAULTS, SPRINGS, motion_report
from neuralocks_core.training.rig.network import TinyNet
from neuralocks_core.training.rig.poses import PosePool
from neuralocks_core.training.rig.static import train_static
from tests.core.rig.builders import branched, character, random_features, random_model, tail, with_balls


def test_torch_and_numpy_pose_alike():
    """Positions, bone ends and skin of a branching chain."""
    rig = branched()
    energy = RigEnergy(rig, RigMaterial(), dtype=torch.float64)
    raw = np.random.default_rng(1).normal(0, 0.5, (4, len(rig.chains), 3))
    turns = half_turns(raw, 2.4)
    np.testing.assert_allclose(bounded_turns(torch.as_tensor(raw), 2.4).numpy(), turns, atol=1e-12)
    rotation, position, ends = energy.pose(torch.as_tensor(turns))
    ours = pose_chains(rig.chains, from_quaternion(turns))
    np.testing.assert_allclose(position.numpy(), ours[1], atol=1e-12)
    np.testing.assert_allclose(ends.numpy(), bone_ends(rig.chains, *ours), atol=1e-12)
    np.testing.assert_allclose(
        energy.skin(rotation, position).numpy(), skin(rig.chains, *ours, rig.points, rig.weights)
    )


@pytest.mark.parametrize("dynamic", [False, True])
def test_a_training_begins_as_the_model_that_it_is_given(dynamic):
    """Whatever the joints' axes and the scale of the inputs: its turns are the model's, and a step changes them little."""
    rig, spec = branched(), rig_spec(dynamic)
    axes = from_vector(np.random.default_rng(0).normal(size=(len(rig.chains), 3)))
    rig = replace(rig, chains=replace(rig.chains, axes=axes))
    torch.manual_seed(0)
    former, net = (TinyNet(6, PosePool(rig, 64, np.random.default_rng(seed)), spec) for seed in (0, 1))
    torch.nn.init.normal_(former.layers[2].weight, std=0.5)
    model = former.model(rig.chains, {})
    features = random_features(model, 64)
    if dynamic:
        net.normalise(features)
    net.begin_as(model)
    with torch.no_grad():
        turns = net(torch.as_tensor(features)).numpy()
    assert np.abs(turns[..., 1:]).max() > 0.3
    np.testing.assert_allclose(turns, model.canonical_turns(features), atol=5e-6)
    train, few = (train_dynamic, {"clips": 2, "clip_seconds": 0.5}) if dynamic else (train_static, {})
    trained = train(rig, steps=1, report_poses=0, begin=model, **few)
    assert trained.training["hidden"] == 6
    off = np.abs(trained.canonical_turns(features) - turns).max()
    assert 0 < off < 0.02


def test_gradient_of_the_energy():
    """Against finite differences in float64."""
    rig = branched()
    energy = RigEnergy(rig, RigMaterial(), dtype=torch.float64)
    raw = torch.tensor(np.random.default_rng(2).normal(0, 0.4, (2, len(rig.chains), 3)), requires_grad=True)
    gravity = torch.tensor([[0.0, -9.81, 0.0], [5.0, 0.0, 8.0]], dtype=torch.float64)

    def total(u):
        turns = bounded_turns(u, 2.4)
        return energy.elastic(turns, gravity, energy.pose(turns)[2]).sum()

    assert torch.autograd.gradcheck(total, (raw,))


def test_the_bind_pose_is_at_rest():
    """The simulation leaves it alone, and a hanging chain swings back to it."""
    rig = branched()
    material = RigMaterial()
    solver = ChainSolver(rig.chains, RodTree(rig.chains, material), material.damping)
    heads = np.tile(np.eye(4), (1, 10, 1, 1))
    turns = solver.simulate(heads, 1 / 30)
    assert np.abs(turns[..., 1:]).max() < 1e-5


def test_a_loose_tail_swings_as_a_pendulum():
    """One stiff bone without bend: period 2 pi sqrt(L / g) of a point mass, within the damping of the integrator."""
    who = character([("hair_1", "head", (0, 1.6, 0)), ("hair_2", "hair_1", (0, 1.3, 0))])
    chains = find_chains(who)
    material = RigMaterial(bend=1e-9, damping=0.0)
    solver = ChainSolver(chains, RodTree(chains, material), 0.0)
    rate = 120
    heads = np.tile(np.eye(4), (1, 3 * rate, 1, 1))
    heads[0, 2:, 0, 3] = 0.03  # a sudden step aside sets it going
    turns = solver.simulate(heads, 1 / rate, substeps=2, warm_up=2)
    angle = 2 * turns[0, 3:, 0, 3]
    crossings = np.flatnonzero(np.diff(np.sign(angle)) != 0)
    period = 2 * np.diff(crossings).mean() / rate
    assert period == pytest.approx(2 * np.pi * np.sqrt(0.3 / 9.81), rel=0.05)


def test_turns_past_half_a_round_go_on_from_the_other_side():
    """A loose tail stays where it was while the head spins: quaternions keep one sign, as networks give them."""
    who = character([("hair_1", "head", (0, 1.6, 0)), ("hair_2", "hair_1", (0, 1.6, -0.3))])
    chains = find_chains(who)
    material = RigMaterial(bend=1e-9, damping=0.0, weight=0.0)
    solver = ChainSolver(chains, RodTree(chains, material), 0.0, weight=0.0)
    heads = np.tile(np.eye(4), (1, 60, 1, 1))
    heads[0, :, :3, :3] = from_vector(np.linspace(0, 5, 60)[:, None] * [0, 1.0, 0])
    turns = solver.simulate(heads, 1 / 60)[0, :, 0].astype(float)
    ahead = np.einsum("tij,tj->ti", heads[0, :, :3, :3] @ from_quaternion(turns), np.tile([0, 0, -1.0], (60, 1)))
    assert np.abs(ahead - [0, 0, -1]).max() < 0.05
    assert (turns[:, 0] >= 0).all() and turns[:, 0].min() < 0.05


def test_a_teleport_and_other_frame_rates():
    """Spring bones are flung and depend on the rate; a function of held poses knows neither."""
    model = random_model(spec=rig_spec())
    who = character([row for c in range(4) for row in tail(f"hair_{c}", 5, at=(0.1 * np.cos(c), 1.6, 0.1 * np.sin(c)))])
    rig = HairRig(who, model.chains, np.zeros((0, 3)), np.zeros((0, 17)))
    report = motion_report(rig, RigMaterial(), {"network": model}, kinds=("turn",))
    assert report["teleport"]["network"] == {"flung_mm": 0.0, "seconds": 0.0}
    assert report["teleport"][SPRINGS]["flung_mm"] > 20 and report["teleport"][SPRINGS]["seconds"] > 0.1
    assert report["rates"]["network"]["24 fps"] < 0.5 < report["rates"][SPRINGS]["24 fps"]
    assert report["cost"]["network"]["bytes_carried_on"] == 0
    assert report["cost"]["network"]["history_multiply_adds"] == 0
    assert set(report["motion_error"]) > {"network", SPRINGS}


def test_direct_optimisation_is_never_worse_than_the_network_it_begins_with(monkeypatch):
    """Where a step of Adam leaves a narrow valley, as between a hat and a shoulder, and does not come back."""

    class Valley:
        """As `RigEnergy.parts`: a degree beside the bottom of a valley it is flat."""

        @staticmethod
        def parts(pool, poses, turns, gravity):
            depth = torch.exp(-(turns[..., 1:] - 0.3).square().sum((-1, -2)) / 0.01**2)
            return -depth, torch.zeros_like(depth)

    monkeypatch.setattr(rig_report, "OPTIMISED", 20)
    turns = np.full((2, 1, 4), 0.3 + np.array([0.004, 0.002])[:, None, None])
    turns[..., 0] = np.sqrt(1 - np.square(turns[..., 1:]).sum(axis=-1))
    found = rig_report._optimise(Valley, None, np.arange(2), None, 2.4, turns, silent)
    energy = [Valley.parts(None, None, torch.as_tensor(state), None)[0].numpy() for state in (turns, found)]
    assert (energy[1] <= energy[0] + 1e-4).all()


def test_chains_are_simulated_coming_to_rest(monkeypatch):
    """Of made-up motion, half of the clips at most stand still for their last 0.8 seconds; all do if all stop midway."""
    standing = []

    def count(rig, material, spec, clips):
        standing.append(sum(bool(np.ptp(clip.joints[-25:], axis=0).max() < 1e-9) for clip in clips))
        raise KeyboardInterrupt

    monkeypatch.setattr(rig_dynamic, "simulate_motions", count)
    for share in (0.0, 1.0):
        monkeypatch.setattr(rig_dynamic, "STOPS", share)
        with pytest.raises(KeyboardInterrupt):
            train_dynamic(with_balls()[0], steps=2, clips=16)
    assert standing[0] <= 8 and standing[1] == 16


def test_progress_goes_on_through_the_report(monkeypatch):
    """In both trainings: never backwards, to the end of the bar, and with messages on the report's progress."""
    monkeypatch.setattr(rig_dynamic, "motion_report", partial(motion_report, kinds=("nod",)))
    monkeypatch.setattr(rig_report, "OPTIMISED", 20)
    rig, _ = with_balls()
    for train, options in ((train_static, {}), (train_dynamic, {"clips": 2, "clip_seconds": 0.5})):
        told = []
        model = train(rig, steps=2, report_poses=4, progress=lambda *state, told=told: told.append(state), **options)
        shares = [done / total for done, total, _ in told]
        assert shares == sorted(shares) and shares[-1] > 0.95
        assert len([message for done, _, message in told if done >= 600]) >= 3 and model.report
    inside = model.report["motion_depth"]  # every eighth sample of four seconds
    assert {name: found["poses"] for name, found in inside.items()} == dict.fromkeys(
        ("simulation", SPRINGS, DEFAULTS, "dynamic network"), 16
    )
    # Half a minute of training would else seem to take half an hour once the bodies are posed.
    at = {message.split()[0]: share for share, (*_, message) in reversed(list(zip(shares, told)))}
    assert at["error"] - at["posing"] > 0.1
