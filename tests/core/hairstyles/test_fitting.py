# SPDX-License-Identifier: Apache-2.0
"""Hair of another head finds its place, and its size, on a scalp."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from neuralocks_core.body.collider import Collider
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import WIDTH, Groom
from neuralocks_core.hairstyles import Scalp
from neuralocks_core.hairstyles.fitting import fit, sphere

CENTRE, RADIUS = np.array([0.1, 1.7, -0.2]), 0.095


@pytest.fixture(scope="module")
def head():
    """A scalp, the upper half of a ball, and the ball."""
    ball = trimesh.creation.icosphere(4, RADIUS)
    points = ball.vertices + CENTRE
    upper = ball.faces[ball.vertices[ball.faces, 1].min(axis=1) > 0]
    return Scalp(points, upper, CENTRE), Collider(points, ball.faces)


def hair(centre, radius, count=300, seed=0) -> Groom:
    """Strands of three vertices that leave the upper half of a ball along its normals."""
    rng = np.random.default_rng(seed)
    out = rng.normal(size=(count, 3))
    out[:, 1] = np.abs(out[:, 1])
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    points = centre + out[:, None] * radius * np.array([1.0, 1.5, 2.0])[:, None]
    return Groom("hair", points.reshape(-1, 3).astype(np.float32), np.full(count, 3), np.full(1, 1e-2, np.float32))


def test_a_sphere_is_found_though_some_points_are_far_off():
    points = hair([3, 2, 1], 5.0).points[::3].astype(float)
    points[:10] *= 3
    centre, radius = sphere(points)
    assert centre == pytest.approx([3, 2, 1], abs=1e-4) and radius == pytest.approx(5.0, abs=1e-4)


def test_hair_of_any_size_and_place_lands_on_the_skin_in_the_heads_size(head):
    for centre, radius in (([0, 0, 0], 60.0), ([5, -3, 9], 0.02)):
        found = fit([hair(centre, radius)], *head)
        points = found.grooms[0].points.reshape(-1, 3, 3)
        assert np.abs(head[1].distance(points[:, 0])[0]).max() < 1e-5
        assert np.linalg.norm(points[:, 2] - CENTRE, axis=1) == pytest.approx(2 * RADIUS, rel=0.03)
        assert found.scale == pytest.approx(RADIUS / radius, rel=0.02)
        assert found.grooms[0].widths == pytest.approx(1e-2 * found.scale)
        assert found.moved.max() < 0.05 * RADIUS


def test_hair_of_a_known_size_keeps_it(head):
    found = fit([hair([1, 1, 1], 0.08)], *head, resize=False)
    points = found.grooms[0].points.reshape(-1, 3, 3)
    assert found.scale == 1.0
    assert np.linalg.norm(points[:, 2] - points[:, 0], axis=1) == pytest.approx(0.08, abs=1e-5)
    assert np.abs(head[1].distance(points[:, 0])[0]).max() < 1e-5


def test_a_thickness_that_no_file_states_is_hairs(head):
    thin = replace(hair([0, 0, 0], 60.0), widths=np.full(1, WIDTH, np.float32))
    assert fit([thin], *head).grooms[0].widths == pytest.approx(WIDTH)


def test_a_part_of_a_head_does_not_tell_its_size(head):
    """The roots of a fringe fit heads of many sizes; of a line, any. If the size is known, they lie on the skin."""
    rng = np.random.default_rng(1)
    side, up = rng.uniform(-0.5, 0.5, 200), rng.uniform(0, 0.1, 200)
    for high in (up, 0 * up):
        out = np.stack([np.sin(side) * np.cos(high), np.sin(high), np.cos(side) * np.cos(high)], axis=1)
        roots = RADIUS * out + rng.normal(0, 0.001, (200, 3)) + [3, 4, 5]
        points = np.stack([roots, roots + 0.05 * out], axis=1)
        fringe = Groom(
            "fringe", points.reshape(-1, 3).astype(np.float32), np.full(200, 2), np.full(1, 1e-4, np.float32)
        )
        with pytest.raises(
            NeuralocksError, match="too small a part of a head to tell how large that is; import it tog"
        ):
            fit([fringe], *head)
        found = fit([fringe], *head, resize=False)
        assert found.scale == 1.0 and found.moved.max() < 0.01
        assert np.abs(head[1].distance(found.grooms[0].points[::2])[0]).max() < 1e-5


def test_parts_of_one_head_stay_together(head):
    whole = hair([0, 0, 0], 1.0)
    left = whole.points.reshape(-1, 3, 3)[:, 0, 0] < 0
    parts = [
        replace(whole, points=whole.points.reshape(-1, 3, 3)[side].reshape(-1, 3), counts=whole.counts[side])
        for side in (left, ~left)
    ]
    together = fit([whole], *head).grooms[0].points.reshape(-1, 3, 3)
    apart = fit(parts, *head).grooms
    assert apart[0].points.reshape(-1, 3, 3) == pytest.approx(together[left], abs=1e-5)
    assert apart[1].points.reshape(-1, 3, 3) == pytest.approx(together[~left], abs=1e-5)


def test_roots_below_the_scalp_do_not_count_and_are_told(head):
    """As many as the hair's: where the hair lies and its size stay the same."""
    hairy, rng = hair([0, 0, 0], 1.0), np.random.default_rng(2)
    chin = rng.normal([0, -1.3, 0.8], 0.15, (300, 1, 3)) + np.array([[0, 0, 0], [0, -0.2, 0]])
    beard = Groom("beard", chin.reshape(-1, 3).astype(np.float32), np.full(300, 2), np.full(1, 1e-2, np.float32))
    alone, both = fit([hairy], *head), fit([hairy, beard], *head)
    assert both.scale == pytest.approx(alone.scale, rel=1e-3)
    assert both.grooms[0].points == pytest.approx(alone.grooms[0].points, abs=1e-4)
    assert alone.off == [0.0] and both.off[0] == 0.0 and both.off[1] > 0.95


def test_empty_strands_are_kept(head):
    full = hair([0, 0, 0], 1.0, count=20)
    counts = full.counts.copy()
    counts[[4, 9]] = [0, 6]  # one without vertices, whose three the tenth has
    found = fit([replace(full, counts=counts)], *head)
    assert len(found.moved) == 19 and np.isfinite(found.grooms[0].points).all()
    assert found.grooms[0].counts.tolist() == counts.tolist()


@pytest.mark.parametrize(
    ("groom", "said"),
    [
        (hair([0, 0, 0], 1.0, count=3), "fewer than 4 strands"),
        (hair([2, 2, 2], 0.0, count=30), "all its roots are in one place"),
    ],
)
def test_hair_that_tells_no_head_is_refused(head, groom, said):
    with pytest.raises(NeuralocksError, match=said):
        fit([groom], *head)
