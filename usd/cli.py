# SPDX-License-Identifier: Apache-2.0
"""The command line `neuralocks`. Each command imports what it needs when it runs, so that `--help` comes at once."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from .command import command_of, note, one_line, print_json

app = typer.Typer(
    name="neuralocks",
    help="Neural hair: moving hair for an animated character, baked to USD without simulating it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Out = Annotated[Path, typer.Option("-o", "--out", help="File to write.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON for a machine to read.")]
Grooms = Annotated[
    list[str] | None, typer.Option("--groom", help="Prim path of a groom; repeat for more. All if left out.")
]
Skeleton = Annotated[str | None, typer.Option("--skeleton", help="Prim path of the skeleton, where there are several.")]
Head = Annotated[str | None, typer.Option("--head", help="Joint that carries hair for which no binding says so.")]
Joints = Annotated[
    list[str] | None,
    typer.Option(
        "--joint", help="MEANING=JOINT, such as left_upper_arm=arm_L, where names do not tell; repeat for more."
    ),
]
Frames = Annotated[
    str | None,
    typer.Option("--frames", help="FIRST:LAST or FIRST:LAST:STEP in time codes; the shot's range if left out."),
]
Materials = Annotated[
    list[str] | None,
    typer.Option(
        "--material",
        help="NAME=VALUE, or NAME=2x for a factor. bend 0.0002..0.005 m^4/s^2, weight 0.5..2 (times gravity), "
        "damping 4..20 /s, clumping 0..240 /s^2.",
    ),
]
Model = Annotated[Path | None, typer.Option("--model", help="A .neuralocks file; the shipped one if left out.")]
Jobs = Annotated[int | None, typer.Option("--jobs", help="Threads; all cores if left out. The result is the same.")]

command = command_of(app)


def main(arguments: list[str] | None = None) -> None:
    """Entry point of `neuralocks`."""
    from neuralocks_core.errors import NeuralocksError

    _add_rig()
    try:
        app(arguments)
    except NeuralocksError as error:  # from commands of other modules
        one_line(f"error: {error}")
        sys.exit(1)


def _add_rig() -> None:
    try:
        from .rig_cli import app as rig_app
    except ModuleNotFoundError:
        return
    if not any(group.name == "rig" for group in app.registered_groups):
        app.add_typer(rig_app, name="rig", help="Rigged mesh hair: train, bake, export.")


@command("bake")
def bake_command(
    shot: Annotated[Path, typer.Argument(help="USD stage with an animated skeleton and at least one groom.")],
    out: Out,
    model: Model = None,
    groom: Grooms = None,
    skeleton: Skeleton = None,
    head: Head = None,
    joint: Joints = None,
    frames: Frames = None,
    subframes: Annotated[int, typer.Option(help="Samples per frame, for motion blur.")] = 1,
    material: Materials = None,
    strength: Annotated[float, typer.Option(help="Motion strength: 0 is each pose as if held, 1 as trained.")] = 1.0,
    resolve: Annotated[bool, typer.Option(help="Push hair out of the body after the network.")] = True,
    loop: Annotated[bool, typer.Option("--loop", help="The clip's last sample is followed by its first.")] = False,
    velocities: Annotated[bool, typer.Option(help="Write velocities for motion blur.")] = True,
    jobs: Jobs = None,
    as_json: AsJson = False,
) -> None:
    """Bake moving hair into a layer that goes over the shot.

    The layer sublayers the shot: open it for the whole shot with moving hair, mute it to have the shot back.
    A bake that was stopped goes on where it was when the same command is given again.
    """
    from .bake import bake
    from .progress import progress_bar

    with progress_bar("baking") as progress:
        result = bake(
            shot, out, model, groom or None, skeleton, head, frames,
            joints=_pairs(joint, "--joint"), subframes=subframes, material=material, strength=strength,
            resolve=resolve, loop=loop, velocities=velocities,
            jobs=jobs, progress=progress,
        )  # fmt: skip
    _bake_report(result, as_json)


@command("simulate")
def simulate_command(
    shot: Annotated[Path, typer.Argument(help="USD stage with an animated skeleton and at least one groom.")],
    out: Out,
    groom: Grooms = None,
    skeleton: Skeleton = None,
    head: Head = None,
    frames: Frames = None,
    material: Materials = None,
    strands: Annotated[
        int | None, typer.Option(help="Simulate at most so many strands; the others follow them.")
    ] = None,
    volume: Annotated[
        float, typer.Option(help="Stiffness against strands crowding closer than in the groom; try 0.3.")
    ] = 0.0,
    as_json: AsJson = False,
) -> None:
    """Bake with the slow reference solver instead of the network, to compare with."""
    from .progress import progress_bar
    from .simulate import simulate

    with progress_bar("simulating") as progress:
        result = simulate(
            shot, out, groom or None, skeleton, head, frames,
            material=material, strands=strands, volume=volume, progress=progress,
        )  # fmt: skip
    _bake_report(result, as_json)


@command("import")
def import_command(
    file: Annotated[Path, typer.Argument(help="TressFX .tfx, Cem Yuksel .hair, .data, CT2Hair .bin or USD curves.")],
    out: Out,
    unit: Annotated[str | None, typer.Option(help="mm, cm, m or metres per unit of the file.")] = None,
    up: Annotated[str | None, typer.Option(help="Upward axis of the file: Y or Z.")] = None,
    as_json: AsJson = False,
) -> None:
    """Write a hair file as a USD groom."""
    from .groom import import_groom
    from .inspect import _groom

    grooms, notes = import_groom(file, out, unit, up)
    note(notes)
    if as_json:
        print_json({"path": str(out), "grooms": [_groom(g) for g in grooms], "notes": notes})
    else:
        for groom in grooms:
            typer.echo(f"{out}: {groom.strand_count} strands, {len(groom.points)} vertices of {groom.name}")


@command("inspect")
def inspect_command(
    file: Annotated[Path, typer.Argument(help="A USD stage, a hair file, a model or a BVH file.")],
    head: Head = None,
    joint: Joints = None,
    as_json: AsJson = False,
) -> None:
    """Say what a file holds, and what would stop or spoil a bake of it."""
    from .inspect import as_text, inspect

    facts = inspect(file, head, _pairs(joint, "--joint"))
    if as_json:
        print_json(facts)
    else:
        typer.echo(as_text(facts))


@command("evaluate")
def evaluate_command(
    baked: Annotated[Path, typer.Argument(help="A bake.")],
    reference: Annotated[bool, typer.Option(help="Compare with the reference solver (minutes).")] = False,
    as_json: AsJson = False,
) -> None:
    """Print a bake's report card."""
    from .evaluate import evaluate
    from .progress import progress_bar

    with progress_bar("evaluating") as progress:
        card = evaluate(baked, reference=reference, progress=progress)
    if as_json:
        typer.echo(card.to_json())
    else:
        typer.echo(card.text())


@command("preview")
def preview_command(
    baked: Annotated[Path, typer.Argument(help="A bake.")],
    out: Out,
) -> None:
    """Draw a bake: a strip of pictures (.png) or a clip (.mp4, .gif)."""
    from .picture import preview
    from .progress import progress_bar

    with progress_bar("drawing") as progress:
        preview(baked, out, progress=progress)
    typer.echo(str(out))


@command("export")
def export_command(
    model: Annotated[Path, typer.Argument(help="A .neuralocks file.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder to write to.")],
) -> None:
    """Unpack a model into plain ONNX files and a description of their inputs."""
    from .export import export_model

    for path in export_model(model, out):
        typer.echo(str(path))


@command("body")
def body_command(
    out: Out,
    phenotype: Annotated[list[str] | None, typer.Option(help="NAME=VALUE of anny's parameters, 0 to 1.")] = None,
) -> None:
    """Write the statistical body anny as a USD character (extra 'body')."""
    from .body import write_body

    typer.echo(str(write_body(out, phenotype=_numbers(phenotype, "--phenotype") or None)))


@command("grow")
def grow_command(
    style: Annotated[str, typer.Argument(help="A style of the procedural library; a wrong one lists them.")],
    character: Annotated[Path, typer.Option(help="USD character to grow it on.")],
    out: Out,
    count: Annotated[int, typer.Option(help="Strands, up to 150,000.")] = 10_000,
    seed: Annotated[int, typer.Option(help="The same seed grows the same groom.")] = 0,
    skeleton: Skeleton = None,
    head: Head = None,
) -> None:
    """Grow a hairstyle on a character and write it as a USD groom."""
    from .grow import grow

    typer.echo(str(grow(style, character, out, count, seed, skeleton=skeleton, head=head)))


@command("demo")
def demo_command(
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder to write to.")] = Path("neuralocks_demo"),
    model: Model = None,
    as_json: AsJson = False,
) -> None:
    """Bake the shipped shot with the shipped model; picture, clip and report card."""
    from .demo import demo
    from .progress import progress_bar

    with progress_bar("demo") as progress:
        done = demo(out, model, progress=progress)
    note([*done.bake.notes, *done.notes])
    outputs = {name: str(path) for name, path in done.outputs.items()}
    if as_json:
        seconds = {name: round(value, 2) for name, value in done.seconds.items()}
        print_json({"shot": str(done.shot), "outputs": outputs, "seconds": seconds, "notes": done.notes})
        return
    typer.echo(done.card.text())
    for name, path in {"shot": str(done.shot), **outputs}.items():
        took = f" ({done.seconds[name]:.1f} s)" if name in done.seconds else ""
        typer.echo(f"{name}: {path}{took}")


@command("train")
def train_command(
    character: Annotated[Path, typer.Option(help="USD character: skeleton, skinned mesh, blend shapes.")],
    out: Out,
    groom: Annotated[
        list[str] | None, typer.Option(help="USD groom, or 'library' for the procedural styles; repeat for more.")
    ] = None,
    motion: Annotated[list[str] | None, typer.Option(help="BVH or USD motion; made-up motion is always added.")] = None,
    minutes: Annotated[float, typer.Option(help="Time to train.")] = 10.0,
    steps: Annotated[int | None, typer.Option(help="Steps to train, in place of minutes.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with an interrupted training, or with a kept one for more minutes.")] = False,
    skeleton: Skeleton = None,
    head: Head = None,
    static: Annotated[bool, typer.Option("--static", help="The quasi-static variant: no history.")] = False,
    rollouts: Annotated[int, typer.Option(help="Simulations to learn from.")] = 1200,
    processes: Annotated[int, typer.Option(help="Processes that simulate while the network trains.")] = 1,
    device: Annotated[str, typer.Option(help="cpu or cuda.")] = "cpu",
    seed: Annotated[int, typer.Option(help="Of everything random.")] = 0,
    credit: Annotated[list[str] | None, typer.Option(help="A line for the model card; repeat for more.")] = None,
    keep_work: Annotated[bool, typer.Option("--keep-work", help="Keep simulations and checkpoint afterwards.")] = False,
) -> None:
    """Train a strand model for a character (extra 'train')."""
    from .progress import progress_bar
    from .train import train

    settings = {"minutes": minutes, "steps": steps, "static": static, "device": device, "seed": seed}
    with progress_bar("training") as progress:
        path = train(
            character, groom or [], motion or [], out, settings, skeleton=skeleton, head=head, resume=resume,
            rollouts=rollouts, processes=processes, credits=credit or [], keep_work=keep_work,
            progress=progress,
        )  # fmt: skip
    typer.echo(str(path))


def _bake_report(result, as_json: bool) -> None:
    note(result.notes)
    if as_json:
        print_json(
            {
                "path": str(result.path),
                "frames": result.frames,
                "grooms": result.grooms,
                "notes": result.notes,
                "seconds": round(result.seconds, 3),
                "resumed": result.resumed,
            }
        )
        return
    for groom in result.grooms:
        typer.echo(f"{groom['path']}: {groom['strands']} strands, carried by {groom['how']}")
    taken = f", {result.resumed} taken over from an interrupted bake" if result.resumed else ""
    first, last = result.frames[0], result.frames[-1]
    typer.echo(
        f"{result.path}: {len(result.frames)} samples from {first:g} to {last:g} in {result.seconds:.1f} s{taken}"
    )


def _pairs(words: list[str] | None, option: str) -> dict[str, str]:
    from neuralocks_core.errors import NeuralocksError

    pairs = {}
    for word in words or ():
        name, equals, value = word.partition("=")
        if not (name.strip() and equals and value.strip()):
            raise NeuralocksError(f"{option} {word}: is not NAME=VALUE; give both sides of '='")
        pairs[name.strip()] = value.strip()
    return pairs


def _numbers(words: list[str] | None, option: str) -> dict[str, float]:
    from neuralocks_core.errors import NeuralocksError

    try:
        return {name: float(text) for name, text in _pairs(words, option).items()}
    except ValueError:
        raise NeuralocksError(f"{option} {' '.join(words or ())}: is not NAME=NUMBER; give numbers") from None
