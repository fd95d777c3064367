# SPDX-License-Identifier: Apache-2.0
"""The paper's training: its moments, its losses, and hair that learns to droop and to swing without a simulation."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.character import Character
from neuralocks_core.deformation.strand_session import strand_inputs
from neuralocks_core.mesh import vertex_normals
from neuralocks_core.physics.bend_twist import Cosserat
from neuralocks_core.skinned_body import Body
from neuralocks_core.training.data.moments import MomentPool, nearest_planes
from neuralocks_core.training.data.rollouts import TrainingScene
from neuralocks_core.training.learning.moment_losses import moment_losses
from neuralocks_core.training.learning.moment_options import SelfSupervisedOptions
from neuralocks_core.training.learning.selfsupervised import paper_boundary, train_on_moments
from neuralocks_core.training.networks import StrandNet
from tests.core.rigs import HEAD, bind, person, straight_hair

SPEC = BoundarySpec(bins=(1,) * 8)


def _ball(radius=0.08):
    """A subdivided octahedron, as (points, triangles)."""
    import trimesh

    mesh = trimesh.creation.icosphere(3, radius)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def _headed():
    points, triangles = _ball()
    body = Body(
        points + bind()[HEAD, :3, 3],
        triangles,
        np.full((len(points), 1), HEAD),
        np.ones((len(points), 1)),
        {"large": 0.1 * points},
    )
    return Character(person().skeleton, body)


@pytest.fixture(scope="module")
def pool():
    pool = MomentPool(TrainingScene(_headed(), (straight_hair(),), spec=SPEC, frames=40, strands=16))
    for _ in range(4):
        pool.grow()
    return pool


@pytest.fixture(scope="module")
def inputs(pool):
    groom = pool.scene.grooms[0]
    return [strand_inputs(groom, np.random.default_rng(0).normal(size=(len(groom.rest), 32)))]


def _net(pool, inputs, **options):
    torch.manual_seed(0)
    net = StrandNet(pool.scene.spec.size)
    frames = np.concatenate([m.vectors for m in pool.moments])
    history = pool.scene.spec.slices["history"]
    net.set_normalisation(torch.from_numpy(inputs[0]), torch.from_numpy(frames), history, **options)
    return net


def _losses(net, pool, inputs, options, count=6, dynamics=1.0, seed=0):
    rng = np.random.default_rng(seed)
    return moment_losses(net, *pool.batch(rng, count), inputs, pool.scene.spec, options, rng, dynamics)


def _values(losses):
    return {name: value.item() for name, value in losses.items()}


def test_the_pool_is_the_same_for_the_same_scene(pool):
    again = MomentPool(pool.scene)
    for _ in range(4):
        again.grow()
    assert len(again.moments) == len(pool.moments) > 8
    for one, two in zip(pool.moments, again.moments):
        np.testing.assert_array_equal(one.vectors, two.vectors)
        np.testing.assert_array_equal(one.back, two.back)


def test_the_body_of_a_moment_has_the_clips_shape_and_lies_where_its_head_sees_it(pool):
    """A ball around the head's joint stays there, however the body moves."""
    for moment in pool.moments:
        (large,), points = pool._maker.draw(moment.hair).shape, moment.surface.data
        np.testing.assert_allclose(np.linalg.norm(points, axis=1), 0.08 * (1 + 0.1 * large), atol=1e-5)
        assert (moment.normals * points).sum(axis=1).min() > 0.95 * 0.08 * (1 + 0.1 * large)
    assert len({len(pool.hair), *(moment.hair for moment in pool.moments)}) == 5


def test_hair_carried_rigidly_by_an_accelerating_head_feels_that_acceleration(pool):
    """x - x^ of a point fixed to the head is the head's own second difference, which the history has as R^T (g - a)."""
    gravity, history = SPEC.slices["gravity"], SPEC.slices["history"]
    for moment in pool.moments:
        origin = np.array([0.0, 0, 0, 1])
        second = origin - 2 * moment.back[0] @ origin + moment.back[1] @ origin
        felt = moment.gravity - second[:3] * 30**2
        vector = moment.vectors[2]
        if np.linalg.norm(felt - moment.gravity) < 5 * 9.81:  # the boundary limits larger ones
            np.testing.assert_allclose(vector[gravity] + vector[history][:3], felt / 9.81, atol=2e-3)


def test_planes_are_outward_and_far_points_have_none():
    from scipy.spatial import cKDTree

    points, triangles = _ball()
    normals = vertex_normals(points, triangles)
    asked = np.array([[0.1, 0, 0], [0.07, 0, 0], [0.5, 0, 0]])
    planes, distance = nearest_planes(cKDTree(points), normals, asked)
    heights = (planes[:, :3] * asked).sum(1) - planes[:, 3]
    np.testing.assert_allclose(heights[:2], [0.02, -0.01], atol=1e-3)
    assert heights[2] > 100 and distance[2] == pytest.approx(0.42, abs=1e-3)


def test_an_untrained_network_leaves_hair_at_rest_and_each_potential_is_there(pool, inputs):
    net = _net(pool, inputs)
    torch.nn.init.zeros_(net.out.weight)
    losses = _values(_losses(net, pool, inputs, SelfSupervisedOptions(style=(100.0,))))
    assert set(losses) == {
        *("stretch", "bend_twist", "gravity", "inertia", "inertia_past", "damping"),
        *("body_collision", "self_collision", "hair_style", "adhesion"),
    }
    for name in ("stretch", "bend_twist", "gravity", "hair_style", "adhesion"):
        assert abs(losses[name]) < 1e-5, name
    assert losses["inertia"] > 1e-4


def test_each_choice_changes_what_is_minimised(pool, inputs):
    net = _net(pool, inputs)
    options = SelfSupervisedOptions(random_materials=False)
    base = _losses(net, pool, inputs, options)
    assert "inertia_past" not in _losses(net, pool, inputs, replace(options, undetached=0.0))
    static = _losses(net, pool, inputs, replace(options, static=True))
    assert not {"inertia", "damping"} & set(static)
    direct = _losses(net, pool, inputs, replace(options, form=Cosserat.DIRECT))
    assert not torch.isclose(direct["bend_twist"], base["bend_twist"], rtol=1e-6)
    free = _losses(net, pool, inputs, replace(options, output="displacement"))
    assert free["stretch"] > 10 * base["stretch"]
    tied = _losses(net, pool, inputs, replace(options, adhesion=3.0))
    assert tied["adhesion"].item() == pytest.approx(3 * base["adhesion"].item(), rel=1e-5)
    heavy = _losses(net, pool, inputs, replace(options, random_materials=True), seed=1)
    assert not torch.isclose(heavy["gravity"], base["gravity"])


def test_grooms_of_few_strands_are_learned_beside_others_each_moment_as_much(pool, inputs):
    """Hair of 16 strands and of 5 cannot be stacked."""
    scene = replace(pool.scene, grooms=(straight_hair(), straight_hair(5, 1)))
    mixed = MomentPool(scene)
    for _ in range(4):
        mixed.grow()
    both = [*inputs, strand_inputs(scene.grooms[1], np.zeros((5, 32)))]
    hair = [mixed.hair[m.hair] for m in mixed.moments]
    few = [i for i, h in enumerate(hair) if len(h.strands) == 5]
    assert 0 < len(few) < len(hair)
    options, net = SelfSupervisedOptions(random_materials=False, volume=0.0), _net(pool, inputs)

    def losses(moments):
        chosen = [mixed.moments[i] for i in moments], [hair[i] for i in moments]
        return _values(moment_losses(net, *chosen, both, SPEC, options, np.random.default_rng(0)))

    alone = [losses([i]) for i in range(len(hair))]
    for name, mean in losses(range(len(hair))).items():
        assert mean == pytest.approx(np.mean([one[name] for one in alone]), rel=1e-4), name


def test_density_is_measured_where_self_collision_counts(pool, inputs):
    free = MomentPool(pool.scene, volume=False)
    free.grow()
    assert free.hair[0].rest_density is None and pool.hair[0].rest_density is not None
    assert "self_collision" not in _losses(_net(pool, inputs), free, inputs, SelfSupervisedOptions(volume=0.0))


def test_a_past_that_is_not_detached_changes_the_gradient(pool, inputs):
    net, grads = _net(pool, inputs), []
    for past in (0.0, 8.0):
        net.zero_grad()
        options = SelfSupervisedOptions(undetached=past, random_materials=False)
        sum(_losses(net, pool, inputs, options).values()).backward()
        grads.append(net.frame.weight.grad.clone())
    assert all(g.isfinite().all() for g in grads) and not torch.allclose(*grads)


def test_hair_finds_less_energy_than_rigid_hair_has(pool, inputs):
    """On the heads that lean most, the learned hair must hang lower, and gain more than it loses by bending and collision."""
    net, options = _net(pool, inputs), SelfSupervisedOptions(static=True, random_materials=False, volume=0.0)
    leaning = sorted(pool.moments, key=lambda m: m.gravity[1])[-6:]
    hair, rng = [pool.hair[m.hair] for m in leaning], np.random.default_rng(0)
    optimiser = torch.optim.Adam(net.parameters(), lr=2e-3)
    for _ in range(150):
        losses = moment_losses(net, leaning, hair, inputs, SPEC, options, rng)
        optimiser.zero_grad()
        sum(losses.values()).backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 5.0)
        optimiser.step()
    end = _values(losses)
    assert end["gravity"] < 0 and sum(end.values()) < 0, "rigid hair has zero"


def test_training_goes_on_from_where_it_was_and_stays_finite(pool, inputs):
    net, options = _net(pool, inputs), SelfSupervisedOptions(steps=12, poses=4, pool=len(pool.moments) + 1)
    before = len(pool.moments)
    states = list(train_on_moments(pool, inputs, net, options, options.optimisers(net), step=7, done=7 / 12))
    assert states[-1].step == 12 and np.isfinite(list(states[-1].losses.values())).all()
    assert len(pool.moments) > before


def test_the_papers_own_settings_train(pool, inputs):
    options = SelfSupervisedOptions.paper(steps=3, poses=2, pool=1)
    assert options.output == "displacement" and options.undetached == 0 and options.form is Cosserat.DIRECT
    assert paper_boundary().steps == 30
    paper_pool = MomentPool(pool.scene, supported=False, nearest_vertices=True)
    paper_pool.grow()
    assert not paper_pool.hair[0].rods.support.any()
    net = _net(pool, inputs)
    states = list(train_on_moments(paper_pool, inputs, net, options, options.optimisers(net)))
    assert states[-1].done == 1.0 and states[-1].step == 3


def test_one_call_trains_the_papers_way_and_says_so(pool, few, in_one_process, tmp_path):
    pytest.importorskip("warp", reason="the gauge compares with the solver")
    from neuralocks_core.models import model_file
    from neuralocks_core.training.train import train_strands

    scene = replace(pool.scene, spec=paper_boundary(), frames=34, strands=8)
    options = SelfSupervisedOptions.paper(steps=6, poses=2, strands=8, pool=1)
    meta = model_file.read(train_strands(scene, tmp_path / "paper.neuralocks", options)).meta
    assert meta["output"] == "displacement" and not meta["anchored"]
    assert meta["training"]["method"].startswith("self-supervised") and meta["training"]["steps"] == 6
    assert meta["training"]["options"]["form"] == "direct" and meta["report"]["held out"]["rigid"] > 0
