# SPDX-License-Identifier: Apache-2.0
"""Carrying deformations back to the groom's own vertices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from neuralocks_core.deformation.carrier import Carrier, Placing
from neuralocks_core.deformation.lengths import keep_lengths
from neuralocks_core.deformation.spans import LEFT_OVER, weights
from neuralocks_core.deformation.turning import turned
from neuralocks_core.groom import Groom
from neuralocks_core.models.network_sizes import K
from neuralocks_core.rotation import transformed
from neuralocks_core.strands.arclength import arc_lengths
from neuralocks_core.strands.strand_set import strand_set
from tests.core.strands.odd_grooms import CENTRE, ORIGIN, coil_groom, ragged_groom


def test_no_deformation_gives_the_same_bytes():
    for groom in (ragged_groom(), coil_groom(), Groom("/zeros", [[-0.0, 0.0, 0.0], [0.0, -0.0, 1.0]], [2])):
        strands = strand_set(groom, ORIGIN, CENTRE, Rotation.from_euler("y", 90, degrees=True).as_matrix())
        still = Carrier(groom, strands).carry(np.zeros_like(strands.rest))
        assert still.tobytes() == groom.points.tobytes()


def test_a_uniform_strand_of_24_moves_exactly_with_the_network():
    t = np.linspace(0, 0.3, K)
    groom = Groom("/hair", np.stack([np.zeros(K), 1.7 + 0 * t, t], axis=1), [K])
    strands = strand_set(groom, ORIGIN, CENTRE)
    np.testing.assert_allclose(strands.rest[0], groom.points - ORIGIN, atol=1e-7)
    displacement = np.random.default_rng(0).normal(size=(1, K, 3)).astype(np.float32)
    np.testing.assert_array_equal(Carrier(groom, strands).carry(displacement), groom.points + displacement[0])


def finer_than_the_network(groom, strands):
    """Which strands (S,) no means of the network's vertices can follow, and how far (P,) [m] own vertices are from its polyline."""
    strand, own, (arc, length) = groom.strand_of_point, groom.points - ORIGIN, arc_lengths(groom)
    place = arc / np.where(strands.valid, length, 1.0)[strand] * (K - 1)
    fine = weights(strands.rest, own, strand, place)[2] & strands.valid
    segment = np.clip(place.astype(int), 0, K - 2)
    share = (place - segment)[:, None]
    line = (1 - share) * strands.rest[strand, segment] + share * strands.rest[strand, segment + 1]
    return fine, np.linalg.norm(own - line, axis=1)


@pytest.mark.parametrize("make", [ragged_groom, coil_groom])
def test_rigid_motion_is_carried_exactly(make):
    """However coarse the network's polyline, turning it as a whole turns every own vertex."""
    groom = make()
    strands = strand_set(groom, ORIGIN, CENTRE)
    turn = Rotation.from_rotvec([0.2, 0.5, -0.3]).as_matrix()
    shift = np.array([0.01, -0.02, 0.03])
    displacement = (strands.rest @ turn.T + shift - strands.rest).astype(np.float32)
    carrier = Carrier(groom, strands)
    carried = carrier.carry(displacement)
    moves = strands.valid[groom.strand_of_point]
    expected = np.where(moves[:, None], (groom.points - ORIGIN) @ turn.T + shift + ORIGIN, groom.points)
    # The smallest rotation of a segment may differ from the turn by a twist about it: own vertices off the
    # polyline may end on the other side of it, but as far from it, and a little farther because they keep their distance to each
    # other. Means of the network's vertices follow exactly, except for their residual, and except in the first segment, which the
    # network never moves.
    off = np.linalg.norm(carried - expected, axis=1)
    fine, beside = finer_than_the_network(groom, strands)
    fine = fine[groom.strand_of_point]
    arc, length = arc_lengths(groom)
    further = 0.02 * length[groom.strand_of_point][fine]
    assert (off[fine] <= 2e-6 + 1.2 * beside[fine] + further).all()
    beyond = ~fine & (arc * (K - 1) >= length[groom.strand_of_point])
    assert (off[beyond] <= 2e-6 + 1.2 * LEFT_OVER).all()
    assert beyond.any() or make is coil_groom


def test_corners_of_a_smooth_groom_turn_with_it():
    """Arcs of 16 vertices, whose corners lie 0.3 mm off the network's polyline: bent to twice their curvature, the
    own edges keep their lengths.
    """
    angle = np.linspace(0.0, 1.6, 16)[None, :, None] * np.linspace(0.7, 1.3, 20)[:, None, None]
    radius = 0.1
    arcs = radius * np.concatenate([np.sin(angle), np.cos(angle) - 1.0, 0 * angle], axis=2)
    groom = Groom("/arcs", (arcs + [0.0, 1.7, 0.05]).reshape(-1, 3), np.full(20, 16))
    strands = strand_set(groom, ORIGIN, CENTRE)
    carrier = Carrier(groom, strands)
    assert not finer_than_the_network(groom, strands)[0].any()
    edges = np.diff(strands.rest, axis=1)
    more = np.linspace(0.0, 1.6, K - 1)[None, :] * np.linspace(0.7, 1.3, 20)[:, None]
    more[:, 0] = 0.0
    x, y = edges[..., 0], edges[..., 1]
    turned = np.stack([x * np.cos(more) + y * np.sin(more), y * np.cos(more) - x * np.sin(more), edges[..., 2]], -1)
    moved = strands.rest.copy()
    moved[:, 1:] = moved[:, :1] + np.cumsum(turned, axis=1)
    carried = carrier.carry((moved - strands.rest).astype(np.float32)).reshape(20, 16, 3)
    before = np.linalg.norm(np.diff(groom.points.reshape(20, 16, 3), axis=1), axis=2)
    after = np.linalg.norm(np.diff(carried, axis=1), axis=2)
    assert np.abs(after / before - 1.0).max() < 1e-4


def test_a_bent_coil_stays_a_coil():
    """Lengths of a coil's own edges survive a bend of 90 degrees of its axis, though 17 of them share a segment."""
    groom = coil_groom()
    strands = strand_set(groom, ORIGIN, CENTRE)
    length = np.linalg.norm(np.diff(strands.rest, axis=1), axis=2)
    angle = np.linspace(0.0, np.pi / 2, K - 1)
    edges = np.diff(strands.rest, axis=1)
    bent = np.stack(
        [
            edges[..., 0] * np.cos(angle) - edges[..., 1] * np.sin(angle),
            edges[..., 0] * np.sin(angle) + edges[..., 1] * np.cos(angle),
            edges[..., 2],
        ],
        axis=-1,
    )
    moved = strands.rest.copy()
    moved[:, 1:] = moved[:, :1] + np.cumsum(bent, axis=1)
    np.testing.assert_allclose(np.linalg.norm(np.diff(moved, axis=1), axis=2), length, atol=1e-6)
    carried = Carrier(groom, strands).carry(moved - strands.rest).reshape(20, -1, 3)
    before = np.linalg.norm(np.diff(groom.points.reshape(20, -1, 3), axis=1), axis=2)
    after = np.linalg.norm(np.diff(carried, axis=1), axis=2)
    assert np.abs(after / before - 1.0).max() < 1e-3  # nowhere torn
    # It still winds around the line that the network's vertices draw.
    ends = moved[:, -1] + ORIGIN
    assert np.linalg.norm(carried[:, -1] - ends, axis=1).max() < 0.02 * length.sum(axis=1).max()


def test_what_lies_beside_the_line_is_not_torn_where_two_segments_meet():
    """Own vertices just before and just after a network vertex at which the line is bent by 60 degrees."""
    edges = np.tile(np.float32([0.01, 0, 0]), (1, 2, 1))
    displacement = np.zeros((1, 3, 3), np.float32)
    displacement[0, 2] = 0.01 * np.array([np.cos(np.pi / 3) - 1, np.sin(np.pi / 3), 0])
    beside = np.tile(np.float32([0, 0.005, 0]), (1, 4, 1))
    places = np.array([[0, 0, 1, 1]]), np.float32([[0.5, 0.999, 0.001, 0.5]])
    moved = turned(edges, displacement, *places, beside)[0]
    assert np.abs(moved[2] - moved[1]).max() < 5e-5 < 1e-3 < np.abs(moved[3] - moved[0]).max()


def test_any_strand_keeps_its_lengths_and_its_root():
    """Strands of 1 to 300 vertices, some of them doubled."""
    rng = np.random.default_rng(0)
    for count in (1, 2, 3, 24, 300):
        rest = (rng.normal(size=(8, count, 3)) * 0.01).astype(np.float32)
        rest[5, 1:3] = rest[5, :1]
        moved = (rng.normal(size=rest.shape) * 0.02).astype(np.float32)
        for smooth in (False, True):
            together = keep_lengths(rest, moved, smooth)
            alone = [keep_lengths(rest[i : i + 1], moved[i : i + 1], smooth) for i in range(8)]
            assert together.tobytes() == np.concatenate(alone).tobytes()
            assert np.array_equal(together[:, 0], moved[:, 0])
            lengths = [np.linalg.norm(np.diff(each.astype(float), axis=1), axis=2) for each in (rest, rest + together)]
            np.testing.assert_allclose(*lengths, atol=1e-6)


def test_hair_that_gets_its_lengths_back_keeps_its_way():
    """Sideways, a turning strand stays nearer to where it was moved than length correction alone would leave it."""
    count, turn = 60, np.linspace(0, 0.5 * np.pi, 59)
    rest = np.linspace(0, 0.25, count)[:, None] * [1.0, 0, 0]
    stretched = 0.25 / 59 * (1 + 0.03 * np.sin(np.linspace(0, 2 * np.pi, 59)))
    edges = stretched[:, None] * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    wanted = np.concatenate([[[0, 0, 0]], np.cumsum(edges, axis=0)])
    along, off = edges / stretched[:, None], []
    for smooth in (False, True):
        moved = keep_lengths(rest[None].astype(np.float32), (wanted - rest)[None].astype(np.float32), smooth)[0]
        drift = (rest + moved - wanted)[1:]
        off.append(np.linalg.norm(drift - (drift * along).sum(axis=1, keepdims=True) * along, axis=1).max())
    assert off[1] < 0.5 * off[0] and off[0] > 0.001


def test_what_lies_in_the_clamped_segment_stays_whatever_moves_behind_it():
    """A corner there, too, although it is off the network's vertices."""
    t = np.linspace(0, 1, 93)
    bow = 0.2 * np.stack([1 - np.cos(t), -np.sin(t), 0 * t], axis=1)
    bow[2, 2] += 3e-4
    groom = Groom("/bow", ORIGIN + CENTRE + bow, [len(t)])
    strands = strand_set(groom, ORIGIN, CENTRE)
    displacement = np.random.default_rng(0).normal(size=strands.rest.shape).astype(np.float32) * 0.01
    displacement[:, :2] = 0
    arc, length = arc_lengths(groom)
    clamped = arc / length[0] * (K - 1) < 1
    moved = Carrier(groom, strands).carry(displacement) - groom.points
    assert clamped.sum() > 3 and not moved[clamped].any() and np.abs(moved[~clamped]).min(axis=1).max() > 1e-3


def test_chunks_and_slices_give_the_whole():
    groom = coil_groom(strands=30, vertices=40)
    strands = strand_set(groom, ORIGIN, CENTRE)
    carrier = Carrier(groom, strands)
    displacement = np.random.default_rng(0).normal(size=strands.rest.shape).astype(np.float32) * 0.02
    whole = carrier.carry(displacement)
    parts = [carrier.carry(displacement[a:b], strands=slice(a, b)) for a, b in ((0, 7), (7, 8), (8, 30))]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    out = np.empty_like(whole)
    assert carrier.carry(displacement, out) is out
    with pytest.raises(ValueError, match="for 7 strands"):
        carrier.carry(displacement, strands=slice(0, 7))


def test_facing_turns_both_ways():
    """A rig that faces +X is read as one that faces +Z, and its displacements go back to its own axes."""
    groom = coil_groom(strands=4, vertices=24, turns=2.0)
    facing = Rotation.from_euler("y", -90, degrees=True).as_matrix()  # +X to +Z
    turned = Groom("/turned", (groom.points - ORIGIN) @ facing + ORIGIN, groom.counts)
    straight, other = strand_set(groom, ORIGIN, CENTRE), strand_set(turned, ORIGIN, CENTRE, facing)
    np.testing.assert_allclose(other.rest, straight.rest, atol=1e-6)
    displacement = np.random.default_rng(0).normal(size=straight.rest.shape).astype(np.float32) * 0.01
    np.testing.assert_allclose(
        (Carrier(turned, other).carry(displacement) - ORIGIN) @ facing.T + ORIGIN,
        Carrier(groom, straight).carry(displacement),
        atol=2e-6,
    )


@pytest.mark.parametrize("vertices", [24, 40])
@pytest.mark.parametrize("turned", [False, True])
def test_a_placed_groom_is_the_carried_one_placed(vertices, turned):
    """Whether vertices are the network's own, which are placed and turned from its axes in one step, or follow them."""
    facing = Rotation.from_euler("y", -70, degrees=True).as_matrix() if turned else np.eye(3)
    way = np.linspace(0, 1, vertices)[None, :, None]
    rng = np.random.default_rng(0)
    roots = ORIGIN + 0.1 * rng.normal(size=(20, 1, 3))
    points = (roots + 0.2 * way * rng.normal(size=(20, 1, 3))).reshape(-1, 3).astype(np.float32)
    groom = Groom("/straight", points, np.full(20, vertices))
    strands = strand_set(groom, ORIGIN, CENTRE, facing)
    carrier = Carrier(groom, strands)
    displacement = rng.normal(size=strands.rest.shape).astype(np.float32) * 0.01
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = Rotation.from_euler("xyz", [0.3, 1.0, -2.0]).as_matrix() * 1.5, [3, 4, 5]
    placed = carrier.carry(displacement, placing=Placing.of(transform, ORIGIN))
    np.testing.assert_allclose(placed, transformed(carrier.carry(displacement), transform), atol=3e-6)
    parts = [
        carrier.carry(displacement[i : i + 5], strands=slice(i, i + 5), placing=Placing.of(transform, ORIGIN))
        for i in (0, 5, 10, 15)
    ]
    np.testing.assert_allclose(np.concatenate(parts), placed, atol=1e-6)
