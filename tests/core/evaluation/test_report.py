# SPDX-License-Identifier: Apache-2.0
"""The report card as text, as JSON and as a picture."""

import json

import numpy as np
import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.evaluation.report import Card


def card():
    times = np.linspace(0, 1, 10)
    wave = np.stack([np.sin(times), 0 * times, np.cos(times)], axis=1)
    return Card(
        "shot.usdc",
        {"/Hair": {"strands": 12, "stretch_percent": 0.0, "droop_cm": 3.25, "settling_s": float("nan")}},
        {"/Hair": {"bake": {"motion_error_median": 0.31}, "rigid": {"motion_error_median": 1.0}}},
        {"/Hair": {"times": times, "reference": wave, "bake": 0.8 * wave, "rigid": 0 * wave}},
        ("a [note] with brackets",),
    )


def test_text_holds_every_number_and_note():
    text = card().text()
    for part in ("/Hair", "strands 12", "3.25", "0.31", "a [note] with brackets", "droop"):
        assert part in text
    assert "nan" not in text


def test_of_many_grooms_one_table_tells_mean_and_worst(tmp_path):
    """Hair in hundreds of prims: nobody reads hundreds of tables, and no picture can be that tall."""
    pytest.importorskip("matplotlib", reason="the extra 'compare' is not installed")
    grooms = {f"/Hair/lock{i}": {"strands": 1 + i % 2, "droop_cm": -float(i), "settling_s": np.nan} for i in range(40)}
    good = {"motion_ratio": 1.05, "tip_correlation": 0.9, "dynamic_frames": 40, "tip_percent": 2.0}
    compared = {name: {"bake": dict(good), "rigid": {"motion_ratio": 0.0}} for name in grooms}
    compared["/Hair/lock3"]["bake"] |= {"motion_ratio": 0.0625, "dynamic_frames": 7}
    compared["/Hair/lock4"]["bake"] |= {"tip_correlation": -0.25, "tip_percent": 31.0}
    text = Card("bake", grooms, compared, notes=("a note",)).text()
    assert len(text.splitlines()) < 25
    (row,) = [line for line in text.splitlines() if "droop" in line]
    mean = np.average(-np.arange(40.0), weights=[1, 2] * 20)
    assert all(word in row for word in (f"{mean:.3g}", "-39", "/Hair/lock39", "cm"))
    assert "settling" not in text
    for measure, worst, name in (
        ("motion ratio", "0.0625", "lock3"),
        ("dynamic samples", "7", "lock3"),
        ("tip curve", "-0.25", "lock4"),
        ("of the tips", "31", "lock4"),
    ):
        (row,) = [line for line in text.splitlines() if measure in line]
        assert f" {worst} " in row and f"/Hair/{name} " in row
    assert "a note" in text
    curves = {name: {"times": np.arange(3.0), "bake": np.zeros((3, 3))} for name in grooms}
    picture = Card("bake", grooms, {}, curves).plot(tmp_path / "curves.svg").read_text()
    assert picture.count("tips, up") == 8


@pytest.mark.parametrize("encoding", ["cp1252", "ascii", "utf-8", None])
def test_text_can_be_written_in_the_code_page_asked_for(encoding):
    measured = card()
    measured.grooms["/Hair_髪"] = measured.grooms["/Hair"]
    text = measured.text(encoding=encoding)
    text.encode(encoding or "utf-8")
    assert "3.25" in text and ("髪" in text or "u9aea" in text)
    assert ("┌" in text) == (encoding not in ("cp1252", "ascii"))


def test_json_is_plain_and_says_null_for_what_was_not_measured():
    values = json.loads(card().to_json())
    assert values["grooms"]["/Hair"]["settling_s"] is None
    assert values["compared"]["/Hair"]["bake"]["motion_error_median"] == 0.31


def test_plot_is_a_picture_and_never_half_written(tmp_path):
    pytest.importorskip("matplotlib", reason="the extra 'compare' is not installed")
    path = card().plot(tmp_path / "curves.png")
    assert path.read_bytes().startswith(b"\x89PNG") and [path] == list(tmp_path.iterdir())
    with pytest.raises(NeuralocksError, match="a file, not a folder"):
        card().plot(path / "curves.png")
    with pytest.raises(NeuralocksError, match="end it in .png"):
        card().plot(tmp_path / "curves.docx")
