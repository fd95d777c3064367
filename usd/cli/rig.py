# SPDX-License-Identifier: Apache-2.0
"""`neuralocks rig`: inspect, train, bake, evaluate and export rigged mesh hair."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from .command import command_of, counted, note, print_json, say
from .options import (
    AsJson,
    Cuts,
    Gusts,
    Head,
    Joints,
    Loop,
    Seed,
    Skeleton,
    Subframes,
    WindVector,
    cut_codes,
    pairs,
    vector,
)
from .progress import progress_bar

app = typer.Typer(no_args_is_help=True, add_completion=False)
command = command_of(app)

Chains = Annotated[
    list[str] | None,
    typer.Option(help="Name pattern of the first joints of hair chains, such as 'Hair*_1'; repeat for more."),
]
ModelArgument = Annotated[Path | None, typer.Argument(help="Model file; the shipped one if left out.")]


@command("train")
def train(
    character: Annotated[Path, typer.Argument(help="USD file with a skinned character and hair joints.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Model file to write, *.neuralocks.")],
    dynamic: Annotated[
        bool, typer.Option("--dynamic/--quasi-static", help="Learn lag, swing and settling, or held poses only.")
    ] = True,
    seconds: Annotated[
        float | None,
        typer.Option(
            help="Seconds to train, without the simulations (see --clips) and the report; 120, or 75 if quasi-static."
        ),
    ] = None,
    steps: Annotated[
        int | None, typer.Option(help="Train this many steps instead; the result is then reproducible.")
    ] = None,
    begin: Annotated[
        Path | None,
        typer.Option(
            metavar="MODEL", help="Train this model of the same chains on, in smaller steps and with its material."
        ),
    ] = None,
    hidden: Annotated[int | None, typer.Option(help="Width of both layers; 32, or 16 if quasi-static.")] = None,
    clips: Annotated[
        int | None, typer.Option(help="Simulated motions to learn from; 256 if left out. Dynamic only.")
    ] = None,
    bend: Annotated[
        float | None,
        typer.Option(
            "--bend", "--stiffness", help="Stiffness over line density, in m^4/s^2; 0.01, or as --begin has it."
        ),
    ] = None,
    weight: Annotated[
        float | None, typer.Option(help="Weight as a multiple of gravity; 1, or as --begin has it.")
    ] = None,
    damping: Annotated[
        float | None,
        typer.Option(help="Damping of motion in the head's frame [1/s]; 6, or as --begin has it. Dynamic only."),
    ] = None,
    seed: Seed = 0,
    chains: Chains = None,
    head: Head = None,
    skeleton: Skeleton = None,
    joint: Joints = None,
    as_json: AsJson = False,
) -> None:
    """Train a tiny network for the hair joints of one rig (extra 'train'). No data is needed."""
    from neuralocks_core.rig.report_text import report_lines

    from ..rig.train import train_rig

    changed = {"bend": bend, "weight": weight, "damping": damping}
    with progress_bar("training") as progress:
        model = train_rig(
            character,
            out,
            dynamic=dynamic,
            seconds=seconds,
            steps=steps,
            hidden=hidden,
            clips=clips,
            material={name: value for name, value in changed.items() if value is not None},
            seed=seed,
            begin=begin,
            chains=chains,
            head=head,
            skeleton=skeleton,
            joints=pairs(joint, "--joint"),
            early=True,
            tell=note,
            progress=progress,
        )
    if as_json:
        print_json({"path": str(out), "training": model.training, "report": model.report})
    else:
        say(
            f"{out}: {counted(len(model.chains), 'hair joint')} in {counted(len(model.chains.roots), 'chain')}, "
            f"{model.training['steps']} steps"
        )
        for line in report_lines(model.report):
            say(line)


@command("bake")
def bake(
    shot: Annotated[Path, typer.Argument(help="USD file with the animated character.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Override layer to write.")],
    model: Annotated[Path | None, typer.Option(help="Model file; the shipped one if left out.")] = None,
    frames: Annotated[
        str | None,
        typer.Option(
            help="FIRST:LAST[:STEP] to sample besides the animation's own samples; the shot's range if left out."
        ),
    ] = None,
    subframes: Subframes = 1,
    loop: Loop = False,
    strength: Annotated[
        float, typer.Option(help="Motion strength of a dynamic model, from 0 to 2; 1 is as trained.")
    ] = 1.0,
    wind: WindVector = None,
    gusts: Gusts = None,
    cuts: Cuts = None,
    head: Head = None,
    skeleton: Skeleton = None,
    joint: Joints = None,
    as_json: AsJson = False,
) -> None:
    """Bake the hair joints of every character that has the model's chains into an override layer over the shot.

    If characters need different models, bake one with --skeleton, then the next from that bake: the last layer moves them all.
    """
    from ..rig.bake import bake_rig

    with progress_bar("baking") as progress:
        result = bake_rig(
            shot,
            out,
            model,
            skeleton=skeleton,
            head=head,
            frames=frames,
            subframes=subframes,
            loop=loop,
            strength=strength,
            wind=vector(wind, "--wind"),
            gusts=gusts,
            cuts=cut_codes(cuts),
            joints=pairs(joint, "--joint"),
            tell=note,
            progress=progress,
        )
    if as_json:
        print_json(asdict(result))
    else:
        rig, *others = result.rigs
        also = f", and {counted(len(others), 'more character')}" if others else ""
        say(
            f"{result.path}: {counted(rig.joints, 'hair joint')}, {counted(rig.samples, 'sample')}, in {rig.animation}{also}"
        )


@command("evaluate")
def evaluate(
    baked: Annotated[Path, typer.Argument(help="A rig bake, or any animated character with hair joints.")],
    chains: Chains = None,
    head: Head = None,
    skeleton: Skeleton = None,
    joint: Joints = None,
    as_json: AsJson = False,
) -> None:
    """Print the report card of hair on bones: how much is inside the body, how far it swings, whether it comes to rest."""
    from ..rig.evaluate import evaluate_rig

    with progress_bar("evaluating") as progress:
        card = evaluate_rig(
            baked, skeleton=skeleton, head=head, chains=chains, joints=pairs(joint, "--joint"), progress=progress
        )
    if as_json:
        print_json({"path": str(card.path), "skeleton": card.skeleton, **card.measures, "notes": card.notes})
        return
    joints, roots = counted(card.measures["joints"], "hair joint"), counted(card.measures["chains"], "chain")
    say(f"{card.skeleton}: {joints} in {roots}")
    for line in card.lines():
        say(line)
    note(card.notes)


@command("export-c", usd=False)
def export_c(
    model: ModelArgument = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="Header to write.")] = Path("hair.h"),
    prefix: Annotated[str, typer.Option(help="Prefix of all names in the header.")] = "nl_hair",
) -> None:
    """Write one self-contained C99 header, usable from C++, and a worked example beside it."""
    from neuralocks_core.rig.export_c import example_beside
    from neuralocks_core.rig.export_c import export_c as write
    from neuralocks_core.rig.network import RigModel

    path = write(RigModel.load(model), out, prefix)
    say(f"{path} and {example_beside(path)}")


@command("inspect")
def inspect(
    character: Annotated[Path, typer.Argument(help="USD file.")],
    chains: Chains = None,
    head: Head = None,
    skeleton: Skeleton = None,
    joint: Joints = None,
    as_json: AsJson = False,
) -> None:
    """List the hair chains of a rig with their lengths and joint counts."""
    from ..rig.notes import chain_notes, rigged_notes
    from ..rig.stage import check_patterns, describe_chains, read_rigged_hair

    hair = read_rigged_hair(character, skeleton=skeleton, head=head, chains=chains, joints=pairs(joint, "--joint"))
    check_patterns(hair, chains)
    rows, notes = describe_chains(hair.rig.chains), rigged_notes(hair.stage_rig) + chain_notes(hair, chains)
    if as_json:
        print_json({"skeleton": hair.stage_rig.path, "chains": rows, "notes": notes})
        return
    say(f"{hair.stage_rig.path}: {counted(len(hair.rig.chains), 'hair joint')} in {counted(len(rows), 'chain')}")
    for row in rows:
        say(f"  {row['name']}: {counted(row['joints'], 'joint')}, {100 * row['length [m]']:.1f} cm")
    note(notes)
