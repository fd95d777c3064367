# SPDX-License-Identifier: Apache-2.0
"""The losses of known motion: what the paper's training is told of the frames before, of materials and of the body."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull, cKDTree

torch = pytest.importorskip("torch", reason="training needs torch")

from neuralocks_core import rotation
from neuralocks_core.body.tree_search import surface_tree
from neuralocks_core.character import Character
from neuralocks_core.materials import MARGIN, Material
from neuralocks_core.models.network_sizes import CODE, STRAND, K
from neuralocks_core.skinned_body import Body
from neuralocks_core.training.data.moments import MomentPool, nearest_planes
from neuralocks_core.training.data.rollouts import TrainingScene
from neuralocks_core.training.learning import methods
from neuralocks_core.training.learning.methods import MomentMethod
from neuralocks_core.training.learning.moment_losses import moment_losses
from neuralocks_core.training.learning.moment_options import SelfSupervisedOptions
from tests.core.rigs import HEAD, bind, person, straight_hair

OPTIONS = SelfSupervisedOptions(output="displacement", supported=False, random_materials=False, volume=0.0)
AT = torch.tensor([4.0, 1.5, 1.0])[:, None, None] * 0.02 * torch.randn(K, 3, generator=torch.Generator().manual_seed(0))
AT[:, :2] = 0
"""Displacements (3, 24, 3) [m] of all strands two steps ago, one step ago and now."""


class Known:
    """A network that gives AT; it keeps what it is told of the frames."""

    def strand_part(self, strands):
        return torch.zeros(*strands.shape[:2], 1)

    def frame_part(self, frames):
        self.frames = frames
        return torch.cat([AT, AT[:1]]).flatten(-2).expand(len(frames), 4, 3 * K)

    def tail(self, strands, frame):
        return frame + strands


class Parting(Known):
    """Each strand moves farther than the one before."""

    def strand_part(self, strands):
        return torch.linspace(0, 0.05, strands.shape[1])[None, :, None].expand(len(strands), -1, 1)


@pytest.fixture(scope="module")
def pool():
    pool = MomentPool(TrainingScene(person(), (straight_hair(),), frames=40, strands=16), supported=False, volume=False)
    pool.grow()
    return pool


def losses(pool, options, hair=None, moment=None, seed=0, dynamics=1.0, net=None):
    moment = moment or pool.moments[0]
    hair = hair or pool.hair[moment.hair]
    inputs, rng = [np.zeros((200, STRAND), np.float32)] * 8, np.random.default_rng(seed)
    found = moment_losses(net or Known(), [moment], [hair], inputs, pool.scene.spec, options, rng, dynamics)
    return {name: value.item() for name, value in found.items()}


def test_inertia_and_damping_are_those_of_the_frames_before(pool):
    """As seen from the head as it is now, and for damping from the head as it was."""
    back = np.tile(np.eye(4), (2, 1, 1))
    back[:, :3, :3] = rotation.from_vector([[0.1, 0.2, -0.1], [0.3, -0.2, 0.1]])
    back[:, :3, 3] = [[0.01, 0.0, -0.02], [0.03, 0.02, 0.0]]
    moment = replace(pool.moments[0], back=back)
    rods, dt = pool.hair[moment.hair].rods, pool.scene.spec.dt
    before2, before, now = (rods.rest + moved for moved in AT)
    one, two = (p @ b[:3, :3].T + b[:3, 3] for p, b in zip((before, before2), torch.from_numpy(back).float()))
    per_mass = rods.mass / rods.length.sum(-1, keepdim=True)
    inertia = ((now - 2 * one + two).square().sum(-1) * per_mass).sum(-1).mean().item() / (2 * dt**2)
    damping = ((AT[2] - AT[1]).square().sum(-1) * per_mass).sum(-1).mean().item() / (2 * dt)
    found = losses(pool, replace(OPTIONS, damping=7.0, undetached=3.0), moment=moment, dynamics=0.5)
    expected = {"inertia": 0.5 * inertia, "inertia_past": 1.5 * inertia, "damping": 3.5 * damping}
    assert {name: found[name] for name in expected} == pytest.approx(expected, rel=1e-4)
    drawn, net = Material.random(np.random.default_rng(3)), Known()
    assert drawn.damping != Material().damping
    found = losses(pool, replace(OPTIONS, random_materials=True), moment=moment, seed=3, net=net)
    assert found["damping"] == pytest.approx(drawn.damping * damping, rel=1e-4)
    told = replace(drawn, weight=1.0).log_ratios()
    assert (net.frames[..., pool.scene.spec.slices["material"]].numpy() == told).all()


def test_moments_have_as_many_strands_as_told_and_scale_the_inputs_with_the_materials_that_are_learned(monkeypatch):
    monkeypatch.setattr(methods, "FIRST", 1)
    scene = TrainingScene(person(), (straight_hair(),), frames=40)
    part = scene.spec.slices["material"]
    for random in (False, True):
        options = replace(OPTIONS, strands=5, random_materials=random, volume=float(random))
        method = MomentMethod(scene, lambda s: np.zeros((len(s.rest), CODE)), options, None, lambda *_: None)
        assert [len(hair.strands) for hair in method.pool.hair] == [5]
        assert (method.pool.hair[0].rest_density is None) == (options.volume == 0)
        assert method.samples()[1][:, part].any() == random
        assert any(moment.vectors[:, part].any() for moment in method.pool.moments), "the pool's own stay"


def test_each_groom_has_its_style_and_the_last_holds_for_further_ones(pool):
    hair, moment = pool.hair[0], pool.moments[0]
    surface, normals = _ball(0.06)
    moment, options = (
        replace(moment, surface=surface, normals=normals),
        replace(OPTIONS, style=(100.0, 300.0), static=True),
    )
    styled = [losses(pool, options, replace(hair, groom=i), moment)["hair_style"] for i in (0, 1, 5)]
    assert styled[0] > 1e-3 and styled[1:] == pytest.approx([3 * styled[0]] * 2)


def test_hair_is_kept_as_far_from_the_body_as_it_may_be(pool):
    """By its own margin, which is less where it rests nearer."""
    surface, normals = _ball(0.06)
    moment, options = replace(pool.moments[0], surface=surface, normals=normals), replace(OPTIONS, static=True)
    hair = pool.hair[moment.hair]
    pushed = [
        losses(pool, options, replace(hair, margin=torch.full_like(hair.margin, margin)), moment)["body_collision"]
        for margin in (-0.1, 0.01, 0.02)
    ]
    assert pushed[0] == 0 < pushed[1] < 0.5 * pushed[2]


def test_a_body_that_only_reaches_behind_a_point_does_not_touch_it():
    """As a shoulder does under the chin. One vertex whose normal points up."""
    touched = {(0, -0.03, 0): True, (0.03, -0.005, 0): False, (0.01, -0.002, 0): True, (0.03, 0.005, 0): True}
    touched |= {(0, -0.045, 0): False, (0, 0.045, 0): False}
    planes, _ = nearest_planes(cKDTree(np.zeros((1, 3))), np.array([[0.0, 1.0, 0.0]]), np.array(list(touched)))
    assert (planes[:, 1] == 1).tolist() == list(touched.values())
    assert (planes[:, 3] < -100).tolist() == [not each for each in touched.values()]


def test_hair_is_tied_to_the_same_vertices_of_its_locks_other_strands(pool):
    hair, groom = pool.hair[0], pool.scene.grooms[0]
    tied, mate = hair.neighbours.numpy(), hair.neighbours.numpy() // K
    strand, vertex, _ = np.nonzero(tied >= 0)
    assert len(strand) and (tied[tied >= 0] % K == vertex).all()
    lock = groom.lock[hair.strands]
    assert (lock[mate[tied >= 0]] == lock[strand]).all() and (mate[tied >= 0] != strand).all()


def test_hair_is_tied_as_firmly_as_its_material_and_the_options_say(pool):
    drawn = Material.random(np.random.default_rng(1))
    plain, twice, random = (
        losses(pool, replace(OPTIONS, static=True, **changes), seed=1, net=Parting())["adhesion"]
        for changes in ({"adhesion": 1.0}, {"adhesion": 2.0}, {"adhesion": 1.0, "random_materials": True})
    )
    assert (twice, random) == pytest.approx((2 * plain, drawn.clumping / Material.clumping * plain), rel=1e-4)
    assert plain > 1e-6


def test_hair_that_rests_near_the_body_may_stay_there():
    """On heads of any shape, each of which it is fitted to."""
    points, _ = _sphere(0.0882)
    head = bind()[HEAD, :3, 3]
    faces = ConvexHull(points).simplices
    inward = (np.cross(*np.diff(points[faces], axis=1).swapaxes(0, 1)) * points[faces[:, 0]]).sum(axis=1) < 0
    faces[inward] = faces[inward, ::-1]
    shapes = {"large": 0.2 * points}
    body = Body(points + head, faces, np.full((len(points), 1), HEAD), np.ones((len(points), 1)), shapes)
    scene = TrainingScene(Character(person().skeleton, body), (straight_hair(),), frames=40, strands=16)
    near = MomentPool(scene, volume=False)
    for _ in range(4):
        near.grow()
    larger = [near._maker.draw(index).shape[0] for index in range(4)]
    assert 0 in larger and np.ptp(larger) > 0.1
    for hair, large in zip(near.hair, larger, strict=True):
        margin, root = hair.margin.numpy(), hair.rods.rest[:, 0].norm(dim=1).numpy()
        assert root == pytest.approx(0.09 + 0.2 * large * 0.0882, abs=1e-3)
        assert margin[:, 0] == pytest.approx(0.0018, abs=7e-4) and margin[:, -1].max() == np.float32(MARGIN)


def _ball(radius):
    """Vertices of a ball around the head joint in a tree, and their normals."""
    points, normals = _sphere(radius)
    return surface_tree(points), normals


def _sphere(radius):
    """Points on a sphere, and its normals there."""
    way = np.random.default_rng(0).normal(size=(4000, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    return radius * way, way
