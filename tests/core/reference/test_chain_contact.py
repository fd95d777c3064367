# SPDX-License-Identifier: Apache-2.0
"""Which points of hair collide, and that no plane that matters is left out of a simulation to save time."""

import numpy as np
import trimesh

from neuralocks_core.body.surface_samples import SurfaceSamples
from neuralocks_core.materials import NO_PLANE
from neuralocks_core.reference.chain_contact import APART, BONE_RADIUS, CORNERS, MORE, Contacts, NearestFaces
from neuralocks_core.rig import find_chains
from tests.core.rig.builders import character, tail


def test_planes_of_moving_bodies_are_those_that_a_search_of_all_finds():
    """Bodies and contacts come and go by turns, far and near, and one body swells on one side; what has no plane is farther away than
    asked.
    """
    rng, ball = np.random.default_rng(0), trimesh.creation.icosphere(3, 0.12)
    samples = SurfaceSamples(ball.vertices, ball.faces, 500)
    near, skipped, met = NearestFaces(samples), 0, 0
    for step in range(60):
        bodies = np.tile(ball.vertices[samples.vertices], (3, 1, 1))
        bodies[1:, :, 0] += (
            0.1 * np.sin(0.4 * step) * np.stack([np.ones(len(bodies[0])), bodies[0, :, 0].clip(0) / 0.12])
        )
        where = np.array([0, 0.3, 0]) + rng.normal(0, 0.02, (3, 5, 3))
        where[:, :3, 1] -= 0.1 + 0.1 * np.cos(0.3 * step + np.arange(3))
        where[:, 3:] = [0.25, 0, 0], [0, 0.22 - 0.0015 * step, 0]  # one stands still, one comes slowly
        reach = np.tile([*rng.uniform(0.005, 0.05, 3), 0.05, 0.015], (3, 1))
        near.move(bodies)
        found = near.planes(where, reach)
        every = NearestFaces(samples)
        every.move(bodies)
        wanted = every.planes(where)
        away = np.einsum("cqi,cqi->cq", wanted[0], where) - wanted[1]
        none = found[1] == NO_PLANE[3]
        assert (away[none] > reach[none] - 1e-3).all()
        for ours, theirs in zip(found, wanted, strict=True):
            np.testing.assert_array_equal(ours[~none], theirs[~none])
        skipped, met = skipped + none.sum(), met + (away < reach).sum()
    assert skipped > 200 and met > 100
    for _ in range(2):  # of what is known to be far, no face is looked for
        found = near.planes(where + 9, reach)
    assert (found[1] == NO_PLANE[3]).all()


def test_bones_without_a_mesh_collide_with_their_middles_and_ends():
    chains = find_chains(character(tail("hair", 3)))
    contacts = Contacts.of_bones(chains)
    start = chains.origins[chains.bone_joint]
    np.testing.assert_allclose(contacts.points, [*(start + chains.bones), *(start + 0.5 * chains.bones)])
    assert list(contacts.joint) == [0, 1, 0, 1] and (contacts.radius == BONE_RADIUS).all()


def test_the_corners_of_each_joints_mesh_collide():
    """Of a small lock its corners, of a large one more; of a joint that drives less than half of all vertices, the bone's end."""
    chains = find_chains(character(tail("hair", 4)))
    corners = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, 8).T
    small = np.concatenate([0.015 * corners, np.full((5, 3), 0.0075)])
    large = np.random.default_rng(0).uniform(0, 0.3, (2000, 3))
    points = np.concatenate([small, large, np.zeros((4, 3))])
    weights = np.zeros((len(points), 4))
    weights[: len(small), 1], weights[len(small) : -4, 2] = 1.0, 0.6
    weights[-4:, 3] = 0.5
    weights[:, 0] = 1 - weights[:, 1:].sum(axis=1)
    contacts = Contacts.of_mesh(chains, points, weights, 0.004)
    mine = [contacts.points[contacts.joint == joint] for joint in range(3)]
    assert {tuple(point) for point in mine[0]} == {tuple(corner) for corner in 0.015 * corners}
    assert len(mine[1]) == CORNERS + MORE and {tuple(point) for point in mine[1]} <= {tuple(point) for point in large}
    gaps = np.linalg.norm(mine[1][:, None] - mine[1][None], axis=2)[np.triu_indices(CORNERS + MORE, 1)]
    assert gaps.min() > 2 * APART
    np.testing.assert_allclose(mine[2], [chains.origins[2] + chains.bones[2]])
    assert (contacts.radius == 0.004).all()
