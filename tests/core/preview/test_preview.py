# SPDX-License-Identifier: Apache-2.0
"""Pictures and clips of hair are files that can be read and last as long as they should, written whole or not at all."""

import sys
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("PIL", reason="the extra 'preview' is not installed")

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.preview import pictures as preview
from neuralocks_core.preview.film import Detail
from tests.core.preview.ball_scene import SMALL, scene
from tests.full_disk import room_for


@pytest.mark.parametrize("samples", [1, 2, 50])
def test_a_clip_shows_the_nearest_sample_and_of_two_as_near_the_earlier(samples):
    rng = np.random.default_rng(samples)
    for times in (np.sort(rng.random(samples)), np.arange(samples) / 12, np.repeat(rng.random(), samples)):
        clock = np.arange(times[0], times[-1] + 0.02, 1 / 24)
        nearest = np.abs(times[None] - clock[:, None]).argmin(axis=1)
        assert np.array_equal(preview.nearest(times, clock), nearest)


@pytest.mark.parametrize("kind", [".png", ".mp4", ".gif"])
def test_pictures_and_clips_show_hair_on_a_body(tmp_path, kind):
    pytest.importorskip("imageio_ffmpeg", reason="the extra 'preview' is not installed")
    path = preview.render(scene(), tmp_path / f"hair{kind}", size=(96, 128), frames=[1, 2], detail=SMALL)
    assert path.stat().st_size > 500 and list(tmp_path.iterdir()) == [path]
    if kind == ".png":
        from PIL import Image

        with Image.open(path) as image:
            assert image.size == (2 * 96 + 4, 128)
            reddish = np.asarray(image, int)
        assert ((reddish[..., 0] - reddish[..., 2]) > 25).mean() > 0.02


def test_a_gif_lasts_as_long_as_its_frames(tmp_path):
    """Its unit is a hundredth of a second, in which most rates are no whole number."""
    from PIL import Image, ImageSequence

    path = preview.render(scene(13), tmp_path / "hair.gif", size=(32, 40), detail=Detail(20, 4, 1, 1))
    with Image.open(path) as image:
        shown = [frame.info["duration"] for frame in ImageSequence.Iterator(image)]
    assert sum(shown) == pytest.approx(1000 * 13 / 24, abs=5) and min(shown) >= 40


@pytest.mark.parametrize("height, least", [(128, 6), (620, 10), (1240, 20)])
def test_a_strip_names_its_frames_in_letters_that_can_be_read(tmp_path, height, least):
    """They had ten pixels in pictures of any size."""
    from PIL import Image

    black = np.zeros((height, height, 3), np.uint8)
    preview._strip(tmp_path / "strip.png", iter([black, black]), ["frame 35", "frame 70"])
    with Image.open(tmp_path / "strip.png") as image:
        drawn = np.asarray(image)[..., 0] > 100
    for picture in (drawn[:, :height], drawn[:, height + 4 :]):
        rows, columns = np.flatnonzero(picture.any(axis=1)), np.flatnonzero(picture.any(axis=0))
        assert least <= np.ptp(rows) + 1 < height / 10 and rows[-1] < height - 1
        assert 0 < columns[0] and columns[-1] < 0.6 * height


def never_drawn():
    return replace(scene(2, 20), hair=lambda frame: pytest.fail("the drawing was begun"))


@pytest.mark.parametrize("name, said", [("hair.bmp", "unknown kind"), ("file/hair.png", "a file, not a folder")])
def test_bad_targets_are_named_before_anything_is_drawn(tmp_path, name, said):
    (tmp_path / "file").write_text("")
    with pytest.raises(NeuralocksError, match=said):
        preview.render(never_drawn(), tmp_path / name, size=(64, 64))


def test_a_missing_writer_is_named_before_anything_is_drawn(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(preview.LacksLibrary, match="imageio-ffmpeg is not installed"):
        preview.render(never_drawn(), tmp_path / "hair.mp4")
    assert not list(tmp_path.iterdir())


def test_a_clip_that_the_disk_cuts_short_leaves_the_earlier_one(tmp_path, capfd):
    pytest.importorskip("imageio_ffmpeg", reason="the extra 'preview' is not installed")
    (tmp_path / "hair.mp4").write_text("earlier")
    with pytest.raises(NeuralocksError, match="no space left"), room_for(1000):
        preview.render(scene(), tmp_path / "hair.mp4", size=(96, 128), detail=SMALL)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["earlier"]
    assert capfd.readouterr().err == ""
