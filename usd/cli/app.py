# SPDX-License-Identifier: Apache-2.0
"""The command line `neuralocks`. Each command imports what it needs when it runs, so that `--help` comes at once."""

import glob
import logging
import os
import sys
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated

import typer

from .assets import body_command, grow_command, import_command
from .bake import bake_command, join_command, simulate_command
from .command import command_of, note, one_line, print_json, say
from .options import (
    AsJson,
    Grooms,
    Head,
    Joints,
    Materials,
    Model,
    Out,
    Skeleton,
    pairs,
    sides,
)
from .rig import app as rig_app
from .train import one_by_one, train_command

app = typer.Typer(
    name="neuralocks",
    help="Neural hair: moving hair for an animated character, baked to USD without simulating it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

command = command_of(app)
command("bake")(bake_command)
command("join")(join_command)
command("simulate")(simulate_command)
command("train")(train_command)
command("import")(import_command)
command("grow")(grow_command)
command("body")(body_command)
app.add_typer(rig_app, name="rig", help="Rigged mesh hair: inspect, train, bake, evaluate, export.")


def main(arguments: list[str] | None = None) -> None:
    """The command line, on these words or those of the process."""
    # Redirected output may be in a code page that lacks a character of a file's name: better shown as its number.
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    # If the home folder cannot be written, as on a farm, matplotlib should not warn about it.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    words = [_kept(word) for word in (sys.argv[1:] if arguments is None else arguments)]
    if os.name == "nt" and words[:1] in (["join"], ["import"]):  # shells there do not expand * and ?
        words = [name for word in words for name in _matching(word)]
    try:
        app(one_by_one(words) if words[:1] == ["train"] else words)
    except OSError as error:  # other errors name their own file; this is a full or closed stdout
        one_line(f"error: {error.filename or 'output'}: {error.strerror or error}; write it elsewhere")
        raise SystemExit(1) from None


def _matching(word: str) -> list[str]:
    """The files that a word with * or ? stands for; the word itself if there are none."""
    return (sorted(glob.glob(word)) if {"*", "?"} & {*word} else []) or [word]


def _kept(word: str) -> str:
    """A word, or a blank for an empty one, because an empty path would be taken as the current folder."""
    return f"{word} " if not word or word.startswith("--") and word.find("=") == len(word) - 1 else word


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import PackageNotFoundError, version

        try:
            number = version("neuralocks")
        except PackageNotFoundError:
            number = "of a source tree that is not installed"
        say(f"neuralocks {number}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass


@command("inspect")
def inspect_command(
    file: Annotated[Path, typer.Argument(help="A USD stage, a hair file, a model or a BVH file.")],
    head: Head = None,
    joint: Joints = None,
    as_json: AsJson = False,
) -> None:
    """Show what a file holds, and what would stop or spoil a bake of it."""
    from ..review.facts_text import as_text
    from ..review.inspect import inspect

    facts = inspect(file, head, pairs(joint, "--joint"))
    if as_json:
        print_json(facts)
    else:
        say(as_text(facts))


@command("evaluate")
def evaluate_command(
    baked: Annotated[Path, typer.Argument(help="A bake.")],
    reference: Annotated[bool, typer.Option(help="Compare with the reference solver (minutes).")] = False,
    groom: Grooms = None,
    skeleton: Skeleton = None,
    head: Head = None,
    joint: Joints = None,
    model: Annotated[
        Path | None,
        typer.Option("--model", help="With --reference: also show this model's hair for each pose as if held."),
    ] = None,
    material: Materials = None,
    plot: Annotated[Path | None, typer.Option(help="Also plot how the tips move (.png, .svg, .pdf).")] = None,
    as_json: AsJson = False,
) -> None:
    """Print a bake's report card. The bake records its material and head; repeat --groom, --skeleton and --joint."""
    from neuralocks_core.evaluation.report import check_plot

    from ..review.evaluate import evaluate
    from .progress import progress_bar

    if plot is not None:
        check_plot(plot)
    with progress_bar("evaluating") as progress:
        card = evaluate(
            baked, reference, grooms=groom or None, skeleton=skeleton, head=head, joints=pairs(joint, "--joint"),
            model=model, material=material or None, progress=progress,
        )  # fmt: skip
    if as_json:
        typer.echo(card.to_json())
    else:
        say(card.text(encoding=sys.stdout.encoding))
    if plot is not None:
        card.plot(plot)


@command("preview")
def preview_command(
    baked: Annotated[Path, typer.Argument(help="A bake; or a character with its groom, which is drawn stiff.")],
    out: Out,
    frames: Annotated[
        str | None,
        typer.Option(
            help="FIRST:LAST in time codes, of a strip also :STEP; a strip shows six of more than twelve.",
            show_default="six of all for a strip, all for a clip",
        ),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(
            help="WIDTHxHEIGHT of one picture in pixels.", show_default="440x620 for a strip, 480x600 for a clip"
        ),
    ] = None,
    view: Annotated[float, typer.Option(help="Degrees from the face to the character's left.")] = 32.0,
    turntable: Annotated[bool, typer.Option("--turntable", help="The camera goes round the character once.")] = False,
    groom: Grooms = None,
    skeleton: Skeleton = None,
    head: Head = None,
) -> None:
    """Draw a bake, or a groom on its character: a strip of pictures (.png) or a clip (.mp4, .gif).

    If there are several characters, it draws the first one with hair, or the one that --groom or --skeleton names.
    """
    from ..review.picture import preview
    from .progress import progress_bar

    with progress_bar("drawing") as progress:
        preview(
            baked,
            out,
            frames=frames,
            size=None if size is None else sides(size),
            view=view,
            turntable=turntable,
            grooms=groom or None,
            skeleton=skeleton,
            head=head,
            tell=note,
            progress=progress,
        )
    say(str(out))


@command("export")
def export_command(
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder to write to.")],
    model: Annotated[
        Path | None,
        typer.Argument(help="A .neuralocks file; if left out, the shipped strand model that suits the shot's grooms."),
    ] = None,
    shot: Annotated[
        Path | None, typer.Option(help="USD stage: also write the data of its grooms that is the same in every frame.")
    ] = None,
    groom: Grooms = None,
    skeleton: Skeleton = None,
    head: Head = None,
    joint: Joints = None,
) -> None:
    """Unpack a model into plain ONNX files and a description of their inputs."""
    from ..models.export import export_model

    for path in export_model(
        model, out, shot, grooms=groom, skeleton=skeleton, head=head, joints=pairs(joint, "--joint")
    ):
        say(str(path))


@command("demo")
def demo_command(
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder to write to.")] = Path("neuralocks_demo"),
    model: Model = None,
    as_json: AsJson = False,
) -> None:
    """Bake the shipped shot with the shipped model; picture, clip and report card."""
    from ..review.demo import demo
    from .progress import progress_bar

    with progress_bar("demo") as progress:
        done = demo(out, model, progress=progress)
    notes = [*done.bake.notes, *done.notes]
    note(notes)
    outputs = {name: str(path) for name, path in done.outputs.items()}
    if as_json:
        seconds = {name: round(value, 2) for name, value in done.seconds.items()}
        print_json({"shot": str(done.shot), "outputs": outputs, "seconds": seconds, "notes": notes})
        return
    say(done.card.text(encoding=sys.stdout.encoding))
    for name, path in {"shot": str(done.shot), **outputs}.items():
        took = f" ({done.seconds[name]:.1f} s)" if name in done.seconds else ""
        say(f"{name}: {path}{took}")


# The order in which help lists them: those needed first, then the rest.
for first in reversed("demo inspect bake join preview evaluate simulate import grow body train export".split()):
    app.registered_commands.sort(key=lambda each: each.name != first)
