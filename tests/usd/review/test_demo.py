# SPDX-License-Identifier: Apache-2.0
"""The demo: it makes all that it names, and says what it could not."""

import json
from dataclasses import replace

import pytest

from neuralocks_core.errors import CannotWrite
from neuralocks_core.evaluation.report import Card
from neuralocks_core.preview.pictures import LacksLibrary
from usd.baking.bake import bake
from usd.cli.app import main
from usd.review.demo import demo


def test_demo_makes_everything_it_names(tmp_path, still_model, monkeypatch, capsys):
    import usd.review.demo

    short = lambda *args, **options: bake(*args, frames="1:9:2", **options)  # noqa: E731
    monkeypatch.setattr(usd.review.demo, "bake", short)
    done = demo(tmp_path / "out", still_model, clip=False)
    assert all(path.is_file() for path in done.outputs.values())
    assert json.loads(done.outputs["report card"].read_text())["grooms"]
    told = replace(done, bake=replace(done.bake, notes=["of the bake"]), notes=["of the picture"])
    monkeypatch.setattr(usd.review.demo, "demo", lambda *args, **options: told)
    with pytest.raises(SystemExit):
        main(["demo", "--json"])
    assert json.loads(capsys.readouterr().out)["notes"] == ["of the bake", "of the picture"]


def test_the_demo_notes_a_missing_library_and_fails_where_a_picture_cannot_be_written(tmp_path, monkeypatch):
    """A full disk was a note beside the report card."""
    import usd.review.demo

    def preview(_baked, path, **_options):
        raise errors.pop()(f"{path.name}: of the picture")

    for name in ("bake", "read_baked"):
        monkeypatch.setattr(usd.review.demo, name, lambda *args, **options: None)
    monkeypatch.setattr(usd.review.demo, "evaluate", lambda *args, **options: Card("", {}, {}, {}))
    monkeypatch.setattr(usd.review.demo, "preview", preview)
    errors = [LacksLibrary, LacksLibrary]
    assert demo(tmp_path).notes == ["demo.png: of the picture", "demo.mp4: of the picture"]
    errors = [CannotWrite]
    with pytest.raises(CannotWrite, match=r"demo\.png"):
        demo(tmp_path)
