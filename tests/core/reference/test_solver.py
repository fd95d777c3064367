# SPDX-License-Identifier: Apache-2.0
"""What the reference promises whatever it is given: exact lengths, rest at rest, no order, no NaN."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("warp", reason="the reference needs warp")
from neuralocks_core.reference import simulate, simulate_xpbd
from neuralocks_core.reference.head_motion import head_motion
from tests.core.reference.swinging_heads import carried, edge_lengths, groom, heads, shaken, sphere


def test_bind_pose_stays_put():
    """Rest support, rest curvature, rest distances and rest offsets: every energy is at rest in the bind pose."""
    rest = groom()
    points, faces = sphere(0.1005)
    head = np.tile(np.eye(4), (8, 1, 1))
    ties = (np.arange(12)[:, None] + [1, 2]) % 12
    result = simulate(rest, head, carried(head, points), faces, neighbours=ties, bind_body=points)
    assert np.abs(result.points - rest).max() < 2e-6
    assert result.residual.max() < 1e-3


@pytest.mark.parametrize("solver", [simulate, simulate_xpbd])
def test_the_distance_from_the_origin_does_not_matter(solver):
    """A power of two, so that the arguments themselves are not rounded."""
    rest, head = groom(6), shaken()
    head[:, :3, 3] = np.round(head[:, :3, 3] * 2**20) / 2**20
    points, faces = sphere()
    body = np.round(carried(head, points).astype(float) * 2**20) / 2**20
    near = solver(rest, head, body, faces).points
    head[:, :3, 3] += 4096.0
    far = solver(rest, head, body + 4096.0, faces).points
    assert np.abs(near - far).max() < 1e-5


def test_the_distance_travelled_does_not_matter():
    """A head that turns in a fast vehicle, kilometres from where it began: single precision would lose the body."""
    rest, head = groom(6), shaken()
    head[:, :3, 3] = 0
    points, faces = sphere()
    body = carried(head, points).astype(float)
    here = simulate(rest, head, body, faces, rest_support=False).points
    way = np.zeros((len(head), 3))
    way[:, 0] = 128.0 * np.arange(len(head))
    head[:, :3, 3] = way
    there = simulate(rest, head, body + way[:, None], faces, rest_support=False).points
    assert np.abs(there - here).max() < 1e-5


def test_constant_velocity_is_rest():
    rest = groom(4)
    t = np.arange(10)[:, None] / 30
    result = simulate(rest, heads(np.zeros((10, 3)), t * [2.0, 0.5, -1.0]))
    assert np.abs(result.points - rest).max() < 1e-5


def test_without_support_hair_droops():
    rest = groom(4, curl=0)
    drooped = simulate(rest, np.eye(4)[None], rest_support=False).points[0]
    assert (drooped[:, -1, 1] < rest[:, -1, 1] - 0.005).all()


def test_lengths_are_exact():
    rest = groom()
    result = simulate(rest, shaken())
    np.testing.assert_allclose(
        edge_lengths(result.points.astype(float)), edge_lengths(rest)[None] * np.ones((20, 1, 1)), rtol=3e-5
    )


def test_order_of_strands_does_not_matter():
    rest, head = groom(), shaken()
    points, faces = sphere()
    body = carried(head, points)
    order = np.random.default_rng(1).permutation(len(rest))
    straight = simulate(rest, head, body, faces).points
    mixed = simulate(rest[order], head, body, faces).points
    np.testing.assert_array_equal(straight[:, order], mixed)


def test_any_motion_stays_finite():
    """Teleports, half turns in a frame and fast spins, with a body and ties."""
    rest = groom(6, curl=0.8)
    rng = np.random.default_rng(3)
    head = heads(
        rng.normal(size=(24, 3)) * 2,
        rng.normal(size=(24, 3)) * np.where(np.arange(24) % 6 == 0, 5, 0.05)[:, None],
    )
    points, faces = sphere()
    ties = (np.arange(6)[:, None] + [1, 2]) % 6
    result = simulate(rest, head, carried(head, points), faces, neighbours=ties)
    assert np.isfinite(result.points).all() and np.isfinite(result.residual).all()
    np.testing.assert_allclose(
        edge_lengths(result.points.astype(float)), edge_lengths(rest)[None] * np.ones((24, 1, 1)), rtol=1e-4
    )


def test_hair_stays_out_of_a_turning_head():
    rest = groom(60, curl=0)
    rest = rest[np.linalg.norm(rest, axis=-1).min(1) > 0.1]
    assert len(rest) > 5
    head = shaken(40, 1.0)
    points, faces = sphere()
    result = simulate(rest, head, carried(head, points), faces, bind_body=points)
    assert np.linalg.norm(result.points, axis=-1)[:, :, 2:].min() > 0.098 * np.cos(np.pi / 24) - 0.003
    assert np.median(result.residual) < 2e-3


def test_hair_meets_a_body_that_comes_from_afar():
    """It was too far to be looked at before, and hair itself rests."""
    straight = np.linspace(0.1, -0.15, 24)[None, :, None] * [0, 1.0, 0]
    points, faces = sphere(0.05)
    way = np.linspace([0.3, -0.1, 0], [0.02, -0.1, 0], 30)[:, None]
    hair = simulate(straight, np.tile(np.eye(4), (30, 1, 1)), points + way, faces).points
    assert np.linalg.norm(hair[:, 0] - way, axis=-1).min() > 0.05 * np.cos(np.pi / 24) - 0.002
    assert hair[-1, 0, -1, 0] < -0.02


def test_stiff_short_hair_is_solved_as_far_as_long_hair():
    """Its energy nearly vanishes while the terms that cancel in it do not, so that rounding exceeds any share of it."""
    rest = groom(curl=0)
    short = rest[:, :1] + 0.1 * (rest - rest[:, :1])
    far = shaken()
    far[:, 0, 3] += np.arange(len(far)) * 30.0
    for head in (shaken(), far):
        result = simulate(short, head, material={"bend": 5e-3})
        assert result.residual.max() < 1e-3 and result.iterations.mean() < 3.1


def test_planes_say_where_the_body_is():
    rest = groom(8)
    head = shaken(6)
    points, faces = sphere()
    result = simulate(rest, head, carried(head, points), faces, bind_body=points, planes=True)
    near = result.planes[..., 3] > -100
    assert near[:, :, 2:6].any()
    away = np.linalg.norm(result.points[:, :, 2:], axis=-1) - 0.098  # to the ball that the flat faces are within
    assert not near[:, :, 2:][away > 0.0205].any() and near[:, :, 2:][away < 0.017].all()
    gap = (result.planes[..., :3] * result.points).sum(-1) - result.planes[..., 3]
    radial = np.linalg.norm(result.points, axis=-1) - 0.098
    assert np.abs(gap - radial)[near].max() < 2.5e-3
    np.testing.assert_allclose(np.linalg.norm(result.planes[..., :3], axis=-1)[near], 1, atol=1e-5)


def test_hair_that_lies_deep_in_the_body_is_known_to_be_there():
    """Even farther below the skin than the distance outside at which hair counts as free."""
    points, faces = sphere()
    head = shaken(6)
    straight = np.linspace(0.09, 0.03, 24)[:, None] * [0, 1.0, 0]
    result = simulate(straight[None], head, carried(head, points), faces, bind_body=points, planes=True)
    gap = (result.planes[..., :3] * result.points).sum(-1) - result.planes[..., 3]
    assert gap[:, 0, 20:] == pytest.approx(np.linalg.norm(result.points[:, 0, 20:], axis=-1) - 0.098, abs=4e-3)


def test_ties_hold_neighbours_together():
    rest = groom(2, curl=0)
    rest[1] = rest[0] + [0.003, 0, 0]
    head = shaken(30, 1.0)
    material = {"bend": np.array([1e-3, 2e-4]), "clumping": 240.0}
    apart = [simulate(rest, head, material=material, neighbours=ties).points for ties in (None, np.array([[1], [0]]))]
    drift = [np.abs((p[:, 0] - p[:, 1]) - (rest[0] - rest[1])).max() for p in apart]
    assert drift[1] < 0.6 * drift[0]


def test_ties_do_not_hold_back_strands_that_move_alike():
    """Each sees where its neighbour was a few Newton steps before, which a strong tie would draw it back to if nothing followed."""
    one, head = groom(1, curl=0), shaken(30)
    rest, material = np.concatenate([one, one + [0.004, 0, 0]]), {"damping": 6.0, "clumping": 240.0}
    free, tied = (simulate(rest, head, material=material, neighbours=n).points for n in (None, np.array([[1], [0]])))
    assert np.abs(tied - free).max() < 5e-3 < 0.1 < np.abs(free - rest).max()


def test_stiffness_and_damping_act():
    rest, head = groom(6, curl=0), shaken(30)
    moved = {}
    for name, values in {"bend": (2e-4, 1e-3, 5e-3), "damping": (4.0, 10.0, 20.0)}.items():
        moved[name] = [np.abs(simulate(rest, head, material={name: v}).points - rest).mean() for v in values]
    for sizes in moved.values():
        assert sizes[0] > sizes[1] > sizes[2]


def test_substeps_follow_the_same_motion():
    rest, head = groom(4, curl=0), shaken(30)
    once, twice, more = (simulate(rest, head, substeps=n, tolerance=1e-5).points for n in (1, 4, 8))
    assert np.abs(twice - more).mean() < 0.5 * np.abs(once - more).mean()


def test_the_skin_of_the_head_moves_with_it_between_frames():
    """A head that nods about the neck and is thrown about: substeps find the skin where a body that is given at each of them has it."""
    rest, head = groom(12, curl=0), shaken(12, 1.2)
    head[:, :3, 3] = 3 * head[:, :3, 3] + head[:, :3, :3] @ [0.0, 0.15, 0.0]
    points, faces = sphere()
    way = head_motion(head, 2)
    finer = np.tile(np.eye(4), (len(way.turn), 1, 1))
    finer[:, :3, :3], finer[:, :3, 3] = Rotation.from_quat(way.turn).as_matrix(), way.origin
    free, held, exact = (
        simulate(rest, motion, body, faces, bind_body=points, dt=step / 60, substeps=step).points[:: 3 - step]
        for motion, body, step in (
            (head, None, 2),
            (head, carried(head, points).astype(float), 2),
            (finer, np.einsum("tij,vj->tvi", finer[:, :3, :3], points) + finer[:, None, :3, 3], 1),
        )
    )
    assert np.abs(held - free).max() > 0.02
    assert np.abs(held - exact).max() < 1e-5


@pytest.mark.parametrize("substeps", [1, 3])
def test_each_frame_of_the_body_is_read_once_in_order(substeps):
    """It may be posed only then."""
    points, faces = sphere()
    read = []

    class Posed(list):
        def __getitem__(self, frame):
            read.append(frame)
            return super().__getitem__(frame)

    head = np.tile(np.eye(4), (4, 1, 1))
    simulate(groom(1), head, Posed([points] * 4), faces, substeps=substeps)
    assert read == [0, 1, 2, 3]


def test_hair_without_gravity_stays_as_it_rests():
    for simulator in (simulate, simulate_xpbd):
        points = simulator(groom(4), np.tile(np.eye(4), (4, 1, 1)), gravity=0.0).points
        np.testing.assert_allclose(points, np.broadcast_to(groom(4), points.shape), atol=1e-6)
