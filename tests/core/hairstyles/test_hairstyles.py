# SPDX-License-Identifier: Apache-2.0
"""The library grows every style on any scalp: the right number of strands, from the skin and out of the body."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from neuralocks_core.body.collider import Collider
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.hairstyles import MOST_STRANDS, STYLES, Obstacle, Scalp, _site, from_head, grow
from neuralocks_core.hairstyles.growth import Site
from neuralocks_core.hairstyles.variation import Variation
from neuralocks_core.mesh import across
from neuralocks_core.strands.strand_set import strand_set

CENTRE = np.array([0.0, 1.66, 0.03])


def ball_scalp(radius=0.09, centre=CENTRE):
    """A sphere's upper half and back, and the whole sphere as the body."""
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    middle = mesh.triangles_center / radius
    hairy = (middle[:, 1] > 0.5) | ((middle[:, 2] < 0.0) & (middle[:, 1] > -0.5))
    points = np.asarray(mesh.vertices) + centre
    return Scalp(points, mesh.faces[hairy], centre), (points, np.asarray(mesh.faces))


SCALP, BODY = ball_scalp()


@cache
def obstacle() -> Obstacle:
    """The body as an obstacle, made when a test needs it, and not when tests are only collected."""
    return Obstacle(SCALP, BODY)


@pytest.mark.parametrize("style", STYLES)
def test_a_style_stands_on_the_scalp_and_clear_of_the_body(style):
    groom = grow(style, SCALP, 400, seed=3, body=obstacle())
    assert groom.strand_count == 400
    assert (groom.counts == groom.counts[0]).all()
    points = groom.points.reshape(400, -1, 3)
    collider = Collider(*BODY)
    assert np.abs(collider.distance(points[:, 0])[0]).max() < 2e-4
    distance = collider.distance(points[:, 1:].reshape(-1, 3))[0]
    assert (distance < 0).mean() < 0.005
    length = np.linalg.norm(np.diff(points, axis=1), axis=2)
    assert 0.002 < length.sum(axis=1).min()
    assert length.sum(axis=1).max() < 0.8
    assert strand_set(groom, CENTRE - [0, 0.06, 0], [0, 0.06, 0]).valid.all()
    # Tips taper, and no strand is wider than ten hairs.
    widths = groom.widths.reshape(400, -1)
    assert (np.diff(widths, axis=1) < 0).all()
    assert widths.max() < 1.01e-3 * SCALP.radius / 0.1
    assert 1 <= groom.guides.sum() <= 400


def test_few_strands_cover_the_head_as_many_hairs_do():
    """At the width of a hair, the 3,200 strands of the shipped shot left the scalp bare in Cycles."""
    size = SCALP.radius / 0.1
    widest = {count: grow("bob", SCALP, count, body=obstacle()).widths.max() for count in (50, 1600, 6400)}
    assert widest[6400] == pytest.approx(size * 9e-5 * np.sqrt(100_000 / 6400), rel=1e-4)
    assert widest[1600] == pytest.approx(2 * widest[6400], rel=1e-4)
    assert widest[50] == pytest.approx(size * 9e-4, rel=1e-4)


@pytest.mark.parametrize("style", ["long_straight", "coils", "braid"])
def test_the_seed_decides(style):
    first, again, other = (grow(style, SCALP, 50, seed, obstacle()).points for seed in (1, 1, 2))
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()


@pytest.mark.parametrize("style", STYLES)
def test_variations_are_of_one_scalp_and_none_is_like_another(style):
    """Each number is another cut of the style, the same for every seed; hair may be pressed into the skin, not through it."""
    grooms = [grow(style, SCALP, 60, 1, obstacle(), variation=number) for number in (0, 1, 2, 3, 4, 5)]
    points = [groom.points.reshape(60, -1, 3) for groom in grooms]
    collider = Collider(*BODY)
    for some in points:
        assert np.abs(collider.distance(some[:, 0])[0]).max() < 2e-4
        assert collider.distance(some.reshape(-1, 3))[0].min() > -0.03
        assert np.linalg.norm(np.diff(some, axis=1), axis=2).sum(axis=1).min() > 0.0005
    tips = [some[:, -1] for some in points]
    apart = [np.linalg.norm(a - b, axis=1).mean() for i, a in enumerate(tips) for b in tips[:i]]
    assert min(apart) > 0.001
    again = grow(style, SCALP, 60, 2, obstacle(), variation=1).points.reshape(60, -1, 3)
    length = [np.linalg.norm(np.diff(some, axis=1), axis=2).sum(axis=1).mean() for some in (points[1], again)]
    assert length[1] == pytest.approx(length[0], rel=0.2)


def test_a_variation_cuts_presses_and_waves_as_it_says():
    plain = Variation.numbered(1, "bob")
    points = grow("long_straight", SCALP, 200, 1, obstacle()).points.reshape(200, -1, 3)
    site = Site(roots=None, seen=None, guide=None, of_clump=np.full((200, 4), 0.5), own=np.zeros((200, 4)))
    length = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    cut = replace(plain, keep=0.5, layers=0.0).trimmed(points, site)
    assert np.linalg.norm(np.diff(cut, axis=1), axis=2).sum(axis=1) == pytest.approx(length / 2, rel=0.02)
    layered = replace(plain, keep=1.0, layers=0.4).trimmed(points, site)
    assert np.linalg.norm(np.diff(layered, axis=1), axis=2).sum(axis=1) == pytest.approx(0.8 * length, rel=0.02)
    np.testing.assert_array_equal(replace(plain, sunk=0.0).pressed(points, obstacle(), 0.9), points)
    pressed = replace(plain, sunk=0.005).pressed(points, obstacle(), 0.9)
    np.testing.assert_array_equal(pressed[:, 0], points[:, 0])
    deeper = obstacle().distance(points.reshape(-1, 3))[0] - obstacle().distance(pressed.reshape(-1, 3))[0]
    assert 0.001 < deeper.max() < 0.006
    assert deeper.min() > -5e-4
    assert replace(plain, wave=0.004, pitch=0.1).of_shape(STYLES["bob"].shape).wave == 0.004
    assert replace(plain, wave=0.004).of_shape(STYLES["coils"].shape).wave == 0


@pytest.mark.parametrize("style", STYLES)
def test_a_single_strand_grows(style):
    assert np.isfinite(grow(style, SCALP, 1, body=obstacle()).points).all()


def test_hair_grows_with_the_head():
    """On a head three times as large, at another place, every length is three times as large."""
    scalp, _ = ball_scalp(0.27, np.array([4.0, -2.0, 1.0]))
    small, large = grow("bob", SCALP, 200), grow("bob", scalp, 200)
    small = (small.points - CENTRE) / 0.09
    large = (large.points - [4.0, -2.0, 1.0]) / 0.27
    np.testing.assert_allclose(large, small, atol=0.01)


def test_styles_differ_as_their_names_say():
    grooms = {style: grow(style, SCALP, 300, body=obstacle()) for style in STYLES}
    points = {style: groom.points.reshape(300, -1, 3) for style, groom in grooms.items()}
    low = {style: np.percentile(p[:, :, 1], 1) - CENTRE[1] for style, p in points.items()}
    assert low["long_straight"] < low["wavy"] < low["bob"] < low["pixie"]
    # Curls: how much longer a strand is than the way it covers in sixteen pieces.
    coarse = {s: np.linalg.norm(np.diff(p[:, ::8], axis=1), axis=2).sum() for s, p in points.items()}
    fine = {
        s: np.linalg.norm(np.diff(p[:, : 1 + 8 * ((p.shape[1] - 1) // 8)], axis=1), axis=2).sum()
        for s, p in points.items()
    }
    curl = {s: fine[s] / coarse[s] for s in STYLES}
    assert curl["long_straight"] < 1.1
    assert curl["tight_curls"] > 1.3
    assert curl["coils"] > 1.5
    # A mohawk's long strands stand in the middle; tied hair passes through one place.
    tall = np.linalg.norm(points["mohawk"][:, -1] - points["mohawk"][:, 0], axis=1) > 0.03
    assert np.abs(points["mohawk"][tall, 0, 0]).max() < 0.03
    for style in ("ponytail", "bun"):
        tie = CENTRE + 0.1 * np.array([0.0, 0.5, -1.0]) / np.linalg.norm([0.0, 0.5, -1.0])
        assert (np.linalg.norm(points[style] - tie, axis=2).min(axis=1) < 0.025).mean() > 0.95


def test_roots_cover_the_scalp_evenly():
    roots = SCALP.roots(4000, np.random.default_rng(0))
    inner = roots.border > 0.02
    direction = (roots.place[inner] - CENTRE) / 0.09
    top = direction[direction[:, 1] > 0.8]
    # Equal areas of a sphere lie between equal steps of height.
    count, _ = np.histogram(top[:, 1], bins=4, range=(0.8, 1.0))
    assert count.std() / count.mean() < 0.15
    np.testing.assert_allclose(np.linalg.norm(roots.normal, axis=1), 1.0, rtol=1e-6)
    assert ((roots.normal * (roots.place - CENTRE)).sum(axis=1) > 0.08).all()


def test_scissors_cut_a_bob_straight_at_the_jaw():
    tips = grow("bob", SCALP, 300, body=obstacle()).points.reshape(300, -1, 3)[:, -1]
    low, high = np.percentile((tips[:, 1] - CENTRE[1]) / SCALP.radius, [1, 90])
    assert -1.5 < low < high < -1.2


def test_long_hair_falls_before_or_behind_the_shoulders():
    """Falling straight, it spreads over the arms."""
    points = (grow("long_straight", SCALP, 300, body=obstacle()).points - CENTRE) / SCALP.radius
    assert np.percentile(np.abs(points[points[:, 1] < -2, 0]), 99) < 1.15


def test_tips_gather_in_locks():
    points = grow("pixie", SCALP, 2000, body=obstacle()).points.reshape(2000, -1, 3)
    root, tip = (np.median(cKDTree(place).query(place, 2)[0][:, 1]) for place in (points[:, 0], points[:, -1]))
    assert tip < 0.8 * root


def test_no_lock_reaches_across_a_parting():
    for style in (STYLES["bob"], STYLES["fringe"]):
        site = _site(style, SCALP, 4000, np.random.default_rng(0), SCALP.radius / 0.1)
        zone = style.zone(site.seen)
        assert len(np.unique(zone)) > 1 and (zone == zone[site.guide]).all()


def test_hair_thins_out_at_the_hairline():
    border = SCALP.roots(4000, np.random.default_rng(0)).border
    at_edge, within = (np.mean((low <= border) & (border < low + 0.003)) for low in (0.0, 0.012))
    assert at_edge < 0.5 * within


def test_a_scalp_is_measured_once(monkeypatch):
    """Each step of each strand asks for its radius: on a scalp of ten thousand triangles, measuring took half of the time."""
    measured, fresh = [], Scalp(SCALP.points, SCALP.triangles, CENTRE)
    monkeypatch.setattr(
        "neuralocks_core.hairstyles.scalp.across", lambda corners: measured.append(len(corners)) or across(corners)
    )
    grow("bob", fresh, 5, body=obstacle())
    assert sum(measured) <= 2 * len(SCALP.triangles)


def test_no_hairline_runs_along_the_seams_of_a_file():
    """Files split a skin along texture seams, and per face if it is flat-shaded: hair thinned out there, as at the hairline."""
    whole = SCALP.roots(500, np.random.default_rng(0))
    left = SCALP.points[SCALP.triangles].mean(axis=1)[:, 0] < 0
    seamed = np.where(left[:, None], SCALP.triangles + len(SCALP.points), SCALP.triangles)
    apart = SCALP.points[SCALP.triangles].reshape(-1, 3)
    for points, triangles in (
        (np.concatenate([SCALP.points, SCALP.points]), seamed),
        (apart, np.arange(len(apart)).reshape(-1, 3)),
    ):
        split = Scalp(points, triangles, CENTRE).roots(500, np.random.default_rng(0))
        np.testing.assert_allclose(split.border, whole.border, atol=1e-12)
        np.testing.assert_allclose(split.place, whole.place, atol=1e-12)


def test_a_scalp_is_marked_on_a_bare_head():
    _, (points, triangles) = ball_scalp()
    scalp = from_head(points, triangles, CENTRE)
    seen = (points[scalp.triangles].mean(axis=1) - CENTRE) / 0.09
    assert 0.25 < scalp.area / (4 * np.pi * 0.09**2) < 0.6
    assert (seen[:, 1] > 0.95).any()  # the crown
    assert ((seen[:, 2] < -0.8) & (seen[:, 1] < -0.1)).any()  # the back
    assert not ((seen[:, 2] > 0.7) & (seen[:, 1] < 0.3)).any()  # not the face
    assert not (seen[:, 1] < -0.9).any()
    assert not ((np.abs(seen[:, 0]) > 0.8) & (seen[:, 1] < 0)).any()  # nor where ears are
    mirrored = np.sort(-seen[:, 0])
    np.testing.assert_allclose(mirrored, np.sort(seen[:, 0]), atol=0.05)


def test_obstacle_agrees_with_exact_distance():
    random = np.random.default_rng(0)
    points = CENTRE + random.normal(size=(500, 3)) * 0.06
    distance, out = obstacle().distance(points)
    exact = np.linalg.norm(points - CENTRE, axis=1) - 0.09
    near = np.abs(exact) < 0.05
    np.testing.assert_allclose(distance[near], exact[near], atol=0.0025)
    assert ((out * (points - CENTRE)).sum(axis=1) / (exact + 0.09) > 0.95)[near].all()


def test_a_mouth_is_no_room_for_hair():
    """A hollow within the head counts as inside, and the way out of it is the way out of the head."""
    points, triangles = BODY
    hollow = CENTRE + 0.4 * (points - CENTRE) + [0, 0, 0.03]
    body = np.concatenate([points, hollow]), np.concatenate([triangles, triangles[:, ::-1] + len(points)])
    within = CENTRE + [0, 0, 0.055]
    assert Collider(*body).distance(within[None])[0] > 0.009
    distance, out = Obstacle(SCALP, body).distance(within[None])
    assert distance < -0.02
    assert out[0, 2] > 0.9
    far = CENTRE + np.array([[0, 0, 0.11], [0.02, 0.1, 0.03], [0, -0.2, 0.1]])
    np.testing.assert_allclose(Obstacle(SCALP, body).distance(far)[0], obstacle().distance(far)[0], atol=1e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: grow("mullet", SCALP, 10), "style 'mullet': is unknown"),
        (lambda: grow("bob", SCALP, 0), "give 1 to 150000"),
        (lambda: grow("bob", SCALP, MOST_STRANDS + 1), "give 1 to 150000"),
        (lambda: Scalp(np.zeros((3, 3)), [[0, 1, 2]], CENTRE), "its area is 0"),
        (lambda: Scalp(np.zeros((3, 3)), [[0, 1, 7]], CENTRE), "not there"),
        (lambda: Scalp(np.full((3, 3), np.nan), [[0, 1, 2]], CENTRE), "not finite"),
        (lambda: grow("bob", None, 10), "scalp: None is not one; give a Scalp"),
        (lambda: grow("bob", SCALP, 10, body=(BODY[0] + 9, BODY[1])), "same space"),
        (lambda: from_head(BODY[0] - [0, 5, 0], BODY[1], CENTRE), "choose another head joint"),
        (lambda: from_head(*BODY, [0.0, 0.06, 0.03]), "reaches 1.7 m above .* give head_centre in bind space"),
        (lambda: grow(["bob"], SCALP, 10), "style ..bob..: is unknown"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(NeuralocksError, match=message):
        call()


@pytest.mark.parametrize(
    ("name", "values"),
    [("count", (100.5, "100", None, True)), ("seed", (-1, 1.5, "a")), ("variation", (-1, 1.5, "1"))],
)
def test_numbers_of_a_style_are_whole(name, values):
    for value in values:
        with pytest.raises(NeuralocksError, match=f"style 'bob': .*{value!r}.*; give .*whole number"):
            grow("bob", SCALP, **{"count": 10, name: value})
