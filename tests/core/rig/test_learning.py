# SPDX-License-Identifier: Apache-2.0
"""What networks of hair on bones learn from, and that they learn it: energies by hand, and two short trainings without a body."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from neuralocks_core.materials import LINEAR
from neuralocks_core.reference.chains import ChainSolver
from neuralocks_core.rig import find_chains, rig_spec
from neuralocks_core.rig.network import POSE
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.rig.rods import RigMaterial, RodTree
from neuralocks_core.rotation import from_vector
from neuralocks_core.training.rig import dynamic as rig_dynamic
from neuralocks_core.training.rig import learning as rig_learning
from neuralocks_core.training.rig import report as rig_report
from neuralocks_core.training.rig import static as rig_static
from neuralocks_core.training.rig.contact import EVERY, GROWING, RENEWED, HairOnBodies, contact_weight
from neuralocks_core.training.rig.dynamic import train_dynamic
from neuralocks_core.training.rig.energy import RigEnergy
from neuralocks_core.training.rig.motion import _errors, simulate_motions
from neuralocks_core.training.rig.report import depths, hair_points, no_turns, static_report
from neuralocks_core.training.rig.static import train_static
from tests.core.rig.builders import branched, character, random_model, tail, with_balls


def bare(rows) -> HairRig:
    """Chains without a mesh."""
    who = character(rows)
    chains = find_chains(who)
    return HairRig(who, chains, np.zeros((0, 3)), np.zeros((0, 1 + len(chains))))


@pytest.mark.parametrize("support", [True, False])
def test_simulated_hair_comes_to_rest_where_the_energy_is_least(support):
    """Both trainings want the same hair: on a head that leans, with other weight, of a chain that forks."""
    rig, material = branched(), RigMaterial(bend=5e-3, weight=1.7, rest_support=support)
    tree, heads = RodTree(rig.chains, material), np.tile(np.eye(4), (2, 40, 1, 1))
    heads[1, :, :3, :3] = from_vector(np.array([0.5, 0.3, -0.4]))
    turns = ChainSolver(rig.chains, tree, material.damping, material.weight).simulate(heads, 1 / 30)[:, -1]
    energy = RigEnergy(rig, material, dtype=torch.float64)
    gravity = torch.as_tensor(np.einsum("cji,j->ci", heads[:, 0, :3, :3], [0, -9.81, 0]))

    def pull(turns) -> np.ndarray:
        """Gradients of the energy by small turns of each joint, (2, N, 3)."""
        small = torch.zeros((*turns.shape[:2], 3), dtype=torch.float64, requires_grad=True)
        w, v = turns[..., :1], turns[..., 1:]
        moved = torch.cat(
            [w - (small * v).sum(-1, keepdim=True) / 2, v + (w * small + torch.linalg.cross(small, v)) / 2], -1
        )
        energy.elastic(moved, gravity, energy.pose(moved)[2]).sum().backward()
        return small.grad.numpy()

    at_rest = torch.as_tensor(np.broadcast_to(no_turns(rig), turns.shape).copy())
    found, bound = pull(torch.as_tensor(turns.astype(float))), pull(at_rest)
    assert np.abs(found).max() < 2e-3 < 0.05 < np.abs(bound[1]).max()
    assert (np.abs(bound[0]).max() < 1e-9) == support  # the bind pose, if it is held against its own weight


def test_contact_is_cubic_and_linear_beyond_two_centimetres():
    rig, material = with_balls()[0], RigMaterial()
    rig = replace(rig, points=rig.points[:3] + [0, 0, -1], weights=rig.weights[:3])  # far from the body
    energy = RigEnergy(rig, material, dtype=torch.float64)
    deep = np.array([-0.01, 0.01, 0.05])
    normals = torch.as_tensor(np.tile([0.6, 0.0, 0.8], (1, 3, 1)))
    points = normals * torch.as_tensor(material.margin - deep)[:, None]  # of planes through the origin
    wanted = np.array([0, 0.01**3, LINEAR**3 + 3 * LINEAR**2 * 0.03]) * material.collision
    for chosen in (None, [0], [1], [2, 0]):
        some = range(3) if chosen is None else chosen
        cost = energy.collision(points[:, some], normals[:, some], torch.zeros(1, len(some)), chosen)
        assert cost.item() == pytest.approx(wanted[list(some)].mean(), rel=1e-9)
    energy.margins[0] = -0.02  # rests 2 cm deep
    assert energy.collision(points[:, :1], normals[:, :1], torch.full((1, 1), 0.03), [0]).item() == 0
    assert energy.collision(points[:, :1], normals[:, :1], torch.full((1, 1), 0.04), [0]).item() > 0
    assert energy.collision(points[:, :1], normals[:, :1], torch.full((1, 1), 0.03), [2]).item() > 0


def test_contact_grows_to_its_full_weight():
    assert [contact_weight(done) for done in (0.0, GROWING / 2, GROWING, 1.0)] == pytest.approx([1e-3, 1e-3**0.5, 1, 1])


def test_the_elastic_energy_is_that_of_random_poses_under_their_own_gravity():
    """Not of those to which hair comes back because it was deepest there."""
    rig, _ = with_balls()
    held, read, rng = (
        HairOnBodies(rig, RigMaterial(), 32, np.random.default_rng(0), rig_spec()),
        [],
        np.random.default_rng(1),
    )
    turn = random_model((1,)).canonical_turns(rng.normal(size=(1, 15)))[0, 0]
    turns = torch.as_tensor(np.tile(turn, (8, len(rig.chains), 1)), dtype=torch.float32)
    for _ in range(4):
        elastic, collision = held.parts(lambda features: read.append(features) or turns, 8)
    energy, gravity = held.energy, 9.81 * read[-1][4:, POSE - 3 : POSE]
    wanted = energy.elastic(turns[4:], gravity, energy.pose(turns[4:])[2])
    assert len(elastic) == 4 and len(collision) == 8
    np.testing.assert_allclose(elastic, wanted, rtol=1e-4)
    assert elastic.std() > 1e-3


@pytest.fixture
def quick(monkeypatch):
    """A rig that a hundred large steps teach a network."""
    monkeypatch.setattr(rig_learning, "_RATE", 0.03)
    return bare(tail("hair", 3, at=(0, 1.6, -0.1), step=(0, -0.08, -0.02)))


def test_a_dynamic_network_learns_what_is_simulated(quick, monkeypatch):
    """The places and the speed of hair in each motion."""
    seen = []

    def kept(*given):
        seen.append(simulate_motions(*given))
        return seen[-1]

    monkeypatch.setattr(rig_dynamic, "simulate_motions", kept)
    model = train_dynamic(quick, steps=120, clips=3, clip_seconds=1.0, batch=64, report_poses=0)
    ((features, truth),) = seen
    turns = {"learned": np.stack([model.canonical_turns(rows) for rows in features])}
    errors = _errors(quick, turns, hair_points(quick, truth), "abc")
    assert max(errors["motion_error_by_kind"]["learned"].values()) < 0.3
    assert errors["motion_ratio"]["learned"] == pytest.approx(1, abs=0.1)


def test_a_quasi_static_network_learns_to_hang(quick, monkeypatch):
    """In poses that it has not seen, with most of the energy that direct optimisation saves."""
    monkeypatch.setattr(rig_report, "OPTIMISED", 60)
    material = RigMaterial(bend=2e-3)
    model = train_static(quick, material, steps=100, report_poses=0)
    report = static_report(model, quick, material, 24, 5, optimised=8)
    energy, off = report["energy"], report["tip_error_mm"]
    assert energy["optimised"] < energy["network"] < 0.6 * energy["optimised"] < energy["rigid"] - 0.1
    assert energy["rigid"] == pytest.approx(0, abs=1e-6) and report["most_turned"]["joint"] in quick.chains.names
    saved = energy["network"] / energy["optimised"]
    assert energy["excess_percent"] == pytest.approx(100 * (1 - saved), abs=1e-3)
    assert 0 == off["optimised"] < off["network"] < 0.6 * off["rigid"]


def test_with_renewed_bodies_what_was_deepest_in_the_old_ones_is_forgotten(monkeypatch):
    rig, _ = with_balls()
    rig = replace(rig, points=rig.points - [0, 0.2, 0])  # in the chest
    held, read, renewed = HairOnBodies(rig, RigMaterial(), 32, np.random.default_rng(0), rig_spec()), [], []
    monkeypatch.setattr(held.pool, "renew", lambda count: renewed.append(len(read)) or np.arange(count))
    turns = torch.as_tensor(np.tile(no_turns(rig), (8, 1, 1)), dtype=torch.float32)
    for _ in range(EVERY):
        held.parts(lambda features: read.append(features.numpy()) or turns, 8)
    assert renewed == [EVERY - 1]
    bodies, features, _ = held._hard
    again = [(read[-1] == row).all(axis=1).any() for row in features[bodies < RENEWED]]
    assert len(bodies) > 40 and all(again)


def test_hair_learns_to_keep_more_than_its_margin_from_the_body(monkeypatch):
    """Networks are not exact to the millimetre."""
    margins = []

    def kept(rig, material, *given):
        margins.append(material.margin)
        if len(margins) in (1, 5):
            raise KeyboardInterrupt  # now all is known
        return SimpleNamespace(pool=SimpleNamespace(collides=True))

    for name in ("HairOnBodies", "DeepestPoses"):
        monkeypatch.setattr(rig_dynamic, name, kept)
    monkeypatch.setattr(rig_static, "HairOnBodies", kept)
    for train, options in ((train_static, {}), (train_dynamic, {"clips": 1, "clip_seconds": 0.2})):
        with pytest.raises(KeyboardInterrupt):
            train(with_balls()[0], steps=1, report_poses=0, **options)
    assert len(margins) == 5 and min(margins) > RigMaterial().margin + 0.005


def test_a_report_measures_a_few_poses_at_a_time_each_with_its_own_body(monkeypatch):
    monkeypatch.setattr(rig_report, "OPTIMISED", 2)
    rig, _ = with_balls()
    rig = replace(rig, points=rig.points - [0, 0.2, 0])  # in the chest, to which the head turns
    model, reports = random_model((len(rig.chains),)), []
    for together in (64, 5):
        monkeypatch.setattr(rig_report, "TOGETHER", together)
        reports.append(static_report(model, rig, RigMaterial(), 12, 5, optimised=2))
    assert reports[0] == reports[1] and reports[0]["penetration_network"]["percent"] > 0


def test_errors_are_relative_to_hair_that_is_carried_rigidly():
    rig, rng = branched(), np.random.default_rng(0)
    truth = random_model((len(rig.chains),)).canonical_turns(rng.normal(size=(60, 15))).reshape(2, 30, -1, 4)
    truth[1, 1:] = truth[1, :1]  # one that stands still
    rigid = np.broadcast_to(no_turns(rig), truth.shape)
    late = np.concatenate([truth[:, :1], truth[:, :-1]], axis=1)
    found = _errors(rig, {"same": truth, "rigid": rigid, "late": late}, hair_points(rig, truth), ["a", "b"])
    assert found["motion_error"].pop("late") > 0 and found["motion_ratio"].pop("late") == pytest.approx(1, abs=0.1)
    assert found["motion_error"] == {"same": 0, "rigid": 1} and found["motion_ratio"] == {"same": 1, "rigid": 0}
    kinds = found["motion_error_by_kind"]
    assert kinds["rigid"] == {"a": 1, "b": 1} and kinds["late"]["a"] > 0.1 and kinds["late"]["b"] == 0


def test_depths_count_vertices_and_poses():
    found = depths(np.array([[0.01, -0.001, -0.004, 1.0], [0.02, 0.03, 1.0, 1.0], [-0.006, 0.0, 1.0, -1e-7]]))
    assert found == pytest.approx(
        {
            "poses": 3,
            "percent": 25.0,
            "percent_deeper_than_3_mm": 100 / 6,
            "percent_of_poses_deeper_than_5_mm": 100 / 3,
            "worst_mm": 6.0,
        }
    )
