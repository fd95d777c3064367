# SPDX-License-Identifier: Apache-2.0
"""Resampling and scalp frames: a groom as the network sees it."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from neuralocks_core.groom import Groom
from neuralocks_core.models.network_sizes import K
from neuralocks_core.reference.rest import rest_rods
from neuralocks_core.strands.centreline import centre_lines
from neuralocks_core.strands.strand_set import StrandSet, root_frames, root_uv, scalp_local, strand_set
from tests.core.strands.odd_grooms import CENTRE, ORIGIN, ragged_groom


def test_samples_divide_the_arc_evenly():
    groom = ragged_groom()
    strands = strand_set(groom, ORIGIN, CENTRE)
    for s in np.flatnonzero(strands.valid)[::9]:
        own = groom.points[groom.starts[s] : groom.starts[s] + groom.counts[s]].astype(float)
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(own, axis=0), axis=1))])
        expected = np.stack([np.interp(np.linspace(0, arc[-1], K), arc, own[:, axis]) for axis in range(3)], axis=1)
        expected = centre_lines(expected[None])[0]
        np.testing.assert_allclose(strands.rest[s], expected - ORIGIN, atol=1e-6)


def test_a_rig_that_faces_elsewhere_has_the_same_strands():
    groom, turn = ragged_groom(), Rotation.from_rotvec([0.1, 2.0, -0.3]).as_matrix()
    turned = replace(groom, points=(groom.points @ turn.T).astype(np.float32))
    as_is, found = strand_set(groom, ORIGIN, CENTRE), strand_set(turned, turn @ ORIGIN, CENTRE, turn.T)
    some = as_is.valid & found.valid
    assert some.sum() > 100
    np.testing.assert_allclose(found.rest[some], as_is.rest[some], atol=1e-6)
    np.testing.assert_allclose(found.root_frame[some], as_is.root_frame[some], atol=1e-4)


def test_whole_locks_are_taken_and_those_of_joined_grooms_stay_apart():
    strands = strand_set(ragged_groom(), ORIGIN, CENTRE)
    taken = strands.whole_locks(40)
    assert len(taken) == 40 and strands.valid[taken].all() and set(strands.whole_locks(20)) < set(taken)
    usable = np.flatnonzero(strands.valid)
    parted = [
        each
        for each in np.unique(strands.lock[taken])
        if (strands.lock[usable] == each).sum() != (strands.lock[taken] == each).sum()
    ]
    assert len(parted) <= 1 and len(np.unique(strands.lock[taken])) > 1
    both = StrandSet.joined([strands, strands])
    count = strands.lock.max() + 1
    np.testing.assert_array_equal(both.lock, np.concatenate([strands.lock, strands.lock + count]))
    np.testing.assert_array_equal(both.rest, np.concatenate([strands.rest, strands.rest]))


def test_strands_without_length_get_a_harmless_stand_in():
    groom = ragged_groom()
    strands = strand_set(groom, ORIGIN, CENTRE)
    distinct = [
        len(np.unique(groom.points[a : a + n], axis=0)) > 1 for a, n in zip(groom.starts, groom.counts, strict=True)
    ]
    np.testing.assert_array_equal(strands.valid, distinct)
    assert 20 < (~strands.valid).sum() < 60
    assert all(np.isfinite(a).all() for a in (strands.rest, strands.uv, strands.root_frame, strands.length))
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(strands.rest[~strands.valid], axis=1), axis=2), 0.01 / (K - 1), rtol=1e-3
    )


def test_root_frames_take_the_normal_up():
    normal = np.random.default_rng(0).normal(size=(500, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal[:2] = [[0, -1, 0], [0, 1, 0]]
    frames = root_frames(normal)
    np.testing.assert_allclose(frames @ frames.transpose(0, 2, 1), np.broadcast_to(np.eye(3), (500, 3, 3)), atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(frames), 1.0, atol=1e-9)
    np.testing.assert_allclose(np.einsum("sij,sj->si", frames, normal), np.tile([0, 1.0, 0], (500, 1)), atol=1e-9)
    # The smallest rotation: its angle is that between the normal and +Y.
    np.testing.assert_allclose(Rotation.from_matrix(frames).magnitude(), np.arccos(normal[:, 1]), atol=1e-6)


def test_scalp_local_forgets_where_the_strand_grows():
    """One strand shape, grown at many places along the normal, has one scalp-local form."""
    random = np.random.default_rng(0)
    normal = random.normal(size=(50, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    shape = np.cumsum(random.normal(size=(K, 3)) * 0.003 + [0, 0.01, 0], axis=0)
    shape -= shape[0]
    grown = np.einsum("sji,kj->ski", root_frames(normal), shape) + 0.09 * normal[:, None] + CENTRE + ORIGIN
    # Uniform samples of the same polyline differ from it only by the resampling.
    local = scalp_local(strand_set(Groom("/hair", grown.reshape(-1, 3), np.full(50, K)), ORIGIN, CENTRE))
    np.testing.assert_allclose(local, np.broadcast_to(local[0], local.shape), atol=1e-5)


def test_uv_keeps_areas_and_fills_the_square():
    normal = np.random.default_rng(0).normal(size=(200_000, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    uv = root_uv(normal * 0.1 + CENTRE, CENTRE)
    assert uv.min() >= 0.0
    assert uv.max() <= 1.0
    # Equal areas on the sphere have equal areas on the map: the density inside the disc is even.
    count, *_ = np.histogram2d(*uv.T, bins=10, range=[[0.15, 0.85]] * 2)
    assert count.std() / count.mean() < 0.05
    np.testing.assert_allclose(root_uv(CENTRE + [[0, 0.1, 0]], CENTRE), [[0.5, 0.5]])


def test_a_strand_that_goes_back_on_itself_is_no_rod():
    """The middle two of its 24 vertices lie at its turning point, so an edge has no direction: the solver would refuse the groom."""
    there = np.linspace(0, 0.1, 12)
    back = np.stack([0 * np.arange(24), np.concatenate([there, there[::-1]]), 0 * np.arange(24)], axis=1)
    straight = np.stack([np.full(24, 0.02), np.linspace(0, 0.2, 24), np.zeros(24)], axis=1)
    groom = Groom("Hair", np.concatenate([back, straight]).astype(np.float32) + np.float32([0, 1.7, 0]), [24, 24])
    strands = strand_set(groom, [0, 1.6, 0], [0, 0.05, 0])
    assert strands.valid.tolist() == [False, True]
    assert rest_rods(strands.rest).length.shape == (2, 24)
