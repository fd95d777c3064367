# SPDX-License-Identifier: Apache-2.0
"""What pictures show of hair, body and clothes, from where and in which light, by either canvas."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.preview import camera as camera_module
from neuralocks_core.preview import plain_canvas, shading
from neuralocks_core.preview.canvas import open_canvas
from neuralocks_core.preview.film import Detail, Film
from tests.core.preview.ball_scene import CENTRE, SMALL, scene


def test_a_giant_is_drawn_as_a_person():
    """The camera stood inside of it."""
    person = scene()
    head = person.head.copy()
    head[:, :3, 3] *= 32
    giant = replace(
        person,
        head=head,
        centre=32 * person.centre,
        rest=32 * person.rest,
        hair=lambda frame: 32 * person.hair(frame),
        body=lambda frame: 32 * person.body(frame),
        body_rest=32 * person.body_rest,
        size=32.0,
    )
    pictures = []
    for each in (person, giant):
        with closing(Film(each, 60, 80, Detail(60, 24, 1, 1), 0.02, plain_canvas.PlainCanvas)) as film:
            pictures.append(next(film.shoot([1])).astype(int))
    assert np.abs(pictures[0] - pictures[1]).max() <= 1 and np.ptp(pictures[0]) > 50


def test_a_pixel_a_quarter_covered_takes_a_quarter_of_the_colour():
    drawn = np.zeros((2, 2, 4), np.uint8)
    drawn[0, 0] = 200, 100, 40, 255
    seen = plain_canvas.composite(drawn, 2, np.full((1, 1, 3), 100))
    np.testing.assert_allclose(seen[0, 0], [125, 100, 85], atol=1)


def moved(person, by):
    """The scene with everything that is posed elsewhere."""
    head = person.head.copy()
    head[:, :3, 3] += by
    return replace(
        person, head=head, hair=lambda frame: person.hair(frame) + by, body=lambda frame: person.body(frame) + by
    )


def drawn(person, kind):
    with closing(Film(person, 120, 160, Detail(600, 24, 2, 1), 0.02, kind)) as film:
        return next(film.shoot([0])).astype(float)


def test_both_canvases_draw_the_same_picture():
    """OpenGL and the plain rasteriser agree on where body and hair are, and nearly on their colours, also far from the origin."""
    gl_canvas = pytest.importorskip("neuralocks_core.preview.gl_canvas", reason="moderngl is not installed")
    try:
        gl_canvas.GlCanvas(8, 8, np.zeros((0, 3), int), 1, SMALL).close()
    except Exception as error:
        pytest.skip(f"OpenGL cannot draw here: {error}")
    kinds = (gl_canvas.GlCanvas, plain_canvas.PlainCanvas)
    pictures = [drawn(scene(), kind) for kind in kinds]
    # Far from the origin single precision knows no millimetres.
    for near, kind in zip(pictures, kinds, strict=True):
        assert np.abs(drawn(moved(scene(), [3e5, 0, -1e5]), kind) - near).max() <= 3
    background = shading.backdrop(120, 160).astype(float)
    covered = [np.abs(picture - background).max(axis=2) > 12 for picture in pictures]
    assert covered[0].mean() > 0.05
    assert (covered[0] != covered[1]).mean() < 0.05
    assert np.abs(pictures[0] - pictures[1])[covered[0] & covered[1]].mean() < 12


@pytest.mark.parametrize("degrees", [0, 180])
def test_a_hair_card_is_drawn_from_both_sides_without_opengl(degrees):
    """As it is with OpenGL: where the back of a card should be, was what is behind it."""
    card = CENTRE + 0.1 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    bare = replace(scene(1), triangles=np.array([[0, 1, 2], [0, 2, 3]]), body=lambda frame: card, body_rest=card)
    with closing(Film(bare, 60, 80, SMALL, 0.02, plain_canvas.PlainCanvas)) as film:
        camera, (body, tint, _, _) = film._camera(0, degrees), film.light(0, degrees)
        drawn = film._canvas.draw(camera, body, np.full_like(tint, 1), np.zeros((0, 3)), np.zeros((0, 3)))
    assert (drawn > 250).all(axis=2).mean() > 0.05


def test_a_lock_split_by_a_seam_has_one_tone():
    lock = CENTRE + 0.1 * np.array([[0, 0, 1.0], [0.1, -1, 1], [-0.1, -1, 1], [0, -2, 1]])
    points = np.concatenate([lock[[0, 1, 2]], lock[[1, 3, 2]], lock[[0, 1, 2]] * [1, 1, -1]])
    mesh = {"triangles": np.arange(9).reshape(3, 3), "body_rest": points, "mesh_hair": np.ones(9, bool)}
    with closing(Film(replace(scene(), **mesh), 44, 62, SMALL, 0.02, plain_canvas.PlainCanvas)) as film:
        first, second, other = film._albedo.reshape(3, 3, 3)
    np.testing.assert_allclose(first[[1, 2]], second[[0, 2]])
    assert np.abs(first - other).max() > 0.01 * first.max()


def test_a_driver_that_gives_up_half_way_is_let_go(monkeypatch):
    gl_canvas = pytest.importorskip("neuralocks_core.preview.gl_canvas", reason="moderngl is not installed")

    class Driver:
        released = False

        def texture(self, *_):
            raise RuntimeError("too large")

        def release(self):
            self.released = True

    driver = Driver()
    monkeypatch.setattr(gl_canvas, "_context", lambda: driver)
    with pytest.raises(RuntimeError, match="too large"):
        gl_canvas.GlCanvas(8, 8, np.zeros((0, 3), int), 1, SMALL)
    assert driver.released


def test_hair_in_front_dims_what_is_behind_it():
    near = np.random.default_rng(0).uniform(0, 0.1, (5000, 3)) * [1, 1, 0.2] + [0, 0, 0.2]
    shadow = shading.ShadowMap(near, np.full(5000, 1e-5))
    behind, before, aside = shadow.depth(
        np.array([[0.05, 0.05, 0.0], [0.05, 0.05, 0.4], [0.5, 0.05, 0.0]]), np.array([0, 0, 1.0])
    )
    assert behind == pytest.approx(5, rel=0.25) and before < 0.05 and aside == 0


def test_light_reaches_the_surface_of_tied_hair():
    """As it reaches that of open hair: a braid was drawn black."""
    rng, towards = np.random.default_rng(0), np.array([0, 0, 1.0])
    around, down = rng.uniform(0, 2 * np.pi, 20000), rng.uniform(-0.3, 0, 20000)
    far = 0.015 * np.sqrt(rng.uniform(0, 1, 20000))
    braid = np.stack([far * np.cos(around), down, far * np.sin(around)], axis=1)
    depth = shading.ShadowMap(braid, np.full(20000, 5e-5)).depth(braid, towards)
    assert np.median(depth[braid[:, 2] > 0.012]) < 2 and np.median(depth[braid[:, 2] < 0]) > 3


@pytest.mark.parametrize("size", [(44, 62), (30, 90), (96, 54)])
@pytest.mark.parametrize("stretch", [[2, 3, 2], [2.9, 1, 1], [1, 2.9, 1]])
def test_a_large_head_or_hairdo_is_in_the_picture_from_all_sides(size, stretch):
    """It was cut off above and at the sides."""
    person = scene()
    large = (person.rest - CENTRE) * stretch + CENTRE
    with closing(Film(replace(person, rest=large), *size, SMALL, 0.02, plain_canvas.PlainCanvas)) as film:
        for azimuth in range(0, 360, 30):
            camera = film._camera(0, azimuth)
            right, up, back = ((large - camera.eye) @ camera.axes).T
            highest = -back * np.tan(np.radians(camera_module.ANGLE) / 2)
            assert (np.abs(up) < highest).all() and (np.abs(right) < highest * size[0] / size[1]).all()


def test_the_view_goes_round_to_the_characters_left():
    with closing(Film(scene(1), 62, 62, SMALL, 0.02, plain_canvas.PlainCanvas)) as film:
        for azimuth, seen_from in ((0, [0, 0, 1]), (90, [1, 0, 0]), (180, [0, 0, -1])):
            assert film._camera(0, azimuth).to_eye @ seen_from > 0.99


def test_copies_beside_strands_turn_with_the_head():
    with closing(Film(scene(), 62, 62, SMALL, 0.02, plain_canvas.PlainCanvas)) as film:
        assert film._copies > 1
        first, last = (film.light(frame, 0)[2] for frame in (0, 3))
        head = film.scene.head[3]
        np.testing.assert_allclose(last, first @ head[:3, :3].T + head[:3, 3], atol=1e-9)


def test_no_camera_flies_across_a_cut():
    """For a third of a second on both sides of it, nobody was in the picture, and after it, only a back."""
    person, half = scene(48), 24
    head = np.tile(np.eye(4), (48, 1, 1))
    head[half:, :3, :3] = np.diag([-1.0, 1, -1])
    head[half:, :3, 3] = [4, 0, -3]
    film = Film(replace(person, head=head, cuts=person.times[[half]]), 62, 62, SMALL, 0.3, plain_canvas.PlainCanvas)
    with closing(film):
        for frame in range(48):
            camera = film._camera(frame, 0)
            right, up, back = ((head[frame, :3, :3] @ CENTRE + head[frame, :3, 3] - camera.eye) @ camera.axes).T
            assert max(abs(right), abs(up)) < -0.5 * back * np.tan(np.radians(camera_module.ANGLE) / 2), frame
            assert (camera.axes[:, 2] @ head[frame, :3, 2]) > 0.9


def test_nobody_who_runs_leaves_the_picture_at_its_ends():
    """The smooth path lagged behind there by half a metre."""
    person = scene(48)
    head = np.tile(np.eye(4), (48, 1, 1))
    head[:, 0, 3] = 6 * person.times
    with closing(Film(replace(person, head=head), 62, 62, SMALL, 0.3, plain_canvas.PlainCanvas)) as film:
        away = film._aims - head[:, :3, 3]
        assert np.abs(away - away[24]).max() < 1e-6


def test_the_picture_of_usual_hair_is_as_near_as_its_length_asks_for():
    with closing(Film(scene(), 62, 62, SMALL, 0.02, plain_canvas.PlainCanvas)) as film:
        reach = np.linalg.norm(film.scene.rest - CENTRE, axis=1).max()
        assert film._far * np.tan(np.radians(camera_module.ANGLE) / 2) == pytest.approx(0.15 + 0.6 * reach)


@pytest.mark.parametrize("size", [1, 32])
@pytest.mark.parametrize(
    "collar, begins", [(None, 1.25), ((1.2, 1.3, 0.2), 1.25), ((1.33, 1.38, 0.2), 1.33), ((1.1, 1.2, 0.2), 1.2)]
)
def test_clothes_begin_between_shoulders_and_neck(collar, begins, size):
    """Children were drawn bare down to the navel."""
    skin = CENTRE - np.linspace(0, 0.5, 500)[:, None] * [0, 1, 0]
    who = replace(scene(), size=size, centre=size * CENTRE, body_rest=size * skin, triangles=np.zeros((0, 3), int))
    who = replace(who, rest=size * who.rest, collar=collar and tuple(size * each for each in collar))
    with closing(Film(who, 44, 62, SMALL, 0.02, plain_canvas.PlainCanvas)) as film:
        bare = np.isclose(film._albedo, shading.SKIN).all(axis=1)
    assert skin[bare, 1].min() == pytest.approx(begins, abs=0.002) and not bare[-1]


@pytest.mark.parametrize("degrees", [0, 90, 200])
def test_arms_of_a_t_pose_have_sleeves(degrees):
    """Below they were cloth, above skin, up to the hands. A head that is wider than shoulders is bare."""
    angle = np.radians(degrees)
    aside = np.array([np.cos(angle), 0, -np.sin(angle)])
    head = CENTRE + np.linspace(-0.7, 0.7, 1401)[:, None] * aside
    arms = head - [0, 0.2, 0]
    facing = np.stack([aside, [0, 1, 0], np.cross(aside, [0, 1, 0])])
    body = {"body_rest": np.concatenate([arms, head]), "triangles": np.zeros((0, 3), int)}
    who = replace(scene(), facing=facing, collar=(1.2, 1.4, 0.2), **body)
    with closing(Film(who, 44, 62, SMALL, 0.02, plain_canvas.PlainCanvas)) as film:
        bare = np.isclose(film._albedo, shading.SKIN).all(axis=1)
    assert bare[len(arms) :].all()
    assert np.abs((arms - CENTRE) @ aside)[bare[: len(arms)]].max() == pytest.approx(0.34, abs=0.005)


def test_without_opengl_numpy_draws(monkeypatch):
    """Whatever the driver raises."""
    moderngl = pytest.importorskip("moderngl", reason="the extra 'preview' is not installed")

    def broken(**settings):
        raise RuntimeError("no driver")

    monkeypatch.setattr(moderngl, "create_context", broken)
    assert isinstance(open_canvas(8, 8, np.zeros((0, 3), int), 1, SMALL), plain_canvas.PlainCanvas)


def test_two_films_at_a_time_do_not_draw_into_each_other():
    with closing(Film(scene(), 60, 80, SMALL, 0.02)) as one, closing(Film(scene(), 60, 80, SMALL, 0.02)) as other:
        first, third = one.shoot([0, 2]), other.shoot([2])
        assert not np.array_equal(next(first), shown := next(third))
        assert np.array_equal(next(first), shown)
