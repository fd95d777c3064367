# SPDX-License-Identifier: Apache-2.0
"""`neuralocks train`."""

from pathlib import Path
from typing import Annotated

import typer

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models.shortcomings import HELD, HELD_BEGUN, KEPT

from .command import note, noting_when_cut_short, print_json, say
from .options import AsJson, Head, Joints, Out, Seed, Skeleton, numbers, pairs

SEVERAL = ("--groom", "--motion", "--set")
"""Options that take all words that follow: a shell's `--motion clips/*.bvh`."""


def one_by_one(words: list[str]) -> list[str]:
    """`--groom A B` as `--groom A --groom B`."""
    option, result = None, []
    for word in words:
        if word.startswith("-"):
            option = word if word in SEVERAL else None
        elif option and result[-1] != option:
            result.append(option)
        result.append(word)
    return result


def train_command(
    character: Annotated[Path, typer.Option(help="USD character: skeleton, skinned mesh, blend shapes.")],
    out: Out,
    groom: Annotated[
        list[str] | None, typer.Option(help="USD grooms, styles of the library, or 'library' for all of these.")
    ] = None,
    motion: Annotated[
        list[str] | None, typer.Option(help="BVH or USD motions; generated motion is always added.")
    ] = None,
    minutes: Annotated[float, typer.Option(help="Time to train.")] = 10.0,
    steps: Annotated[
        int | None, typer.Option(help="Steps to train, in place of minutes; the result is then reproducible.")
    ] = None,
    begin: Annotated[
        str | None,
        typer.Option(
            metavar="MODEL",
            help="Start from what this model has learned, from the 'shipped' one that knows such hair best, or from 'nothing'.",
            show_default="shipped, where it fits",
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Resume an interrupted training, or continue a kept one for more minutes.")
    ] = False,
    skeleton: Skeleton = None,
    head: Head = None,
    joint: Joints = None,
    static: Annotated[bool, typer.Option("--static", help="The quasi-static variant: no history.")] = False,
    variations: Annotated[
        int, typer.Option(min=0, max=50, help="Variations of each library style, besides the style itself.")
    ] = 0,
    gesture: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND=TIMES",
            help="How often generated motion has a kind of gesture, relative to the others: bow=3; repeat for more.",
        ),
    ] = None,
    rollouts: Annotated[
        int, typer.Option(help="Simulations to make and learn from, the latest 1200 at a time.")
    ] = 4000,
    processes: Annotated[int, typer.Option(help="Processes that simulate while the network trains.")] = 1,
    method: Annotated[
        str,
        typer.Option(
            help="rollouts: learn from simulations made during training; selfsupervised: the paper's, from the physics alone."
        ),
    ] = "rollouts",
    paper: Annotated[
        bool,
        typer.Option("--paper", help="With selfsupervised, the paper's network, bending, adhesion and damping."),
    ] = False,
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="NAME=VALUE of the method's options; an unknown name lists them.")
    ] = None,
    device: Annotated[str, typer.Option(help="cpu or cuda.")] = "cpu",
    seed: Seed = 0,
    credit: Annotated[list[str] | None, typer.Option(help="A credit for the model card; repeat for more.")] = None,
    keep_work: Annotated[bool, typer.Option("--keep-work", help="Keep simulations and checkpoint when done.")] = False,
    as_json: AsJson = False,
) -> None:
    """Train a strand model for a character (extra 'train')."""
    from neuralocks_core.models import model_file

    from ..models.train import train
    from .progress import progress_bar

    settings = {"minutes": minutes, "steps": steps, "static": static, "device": device, "seed": seed}
    with noting_when_cut_short(lambda: _how_to_go_on(out)), progress_bar("training") as progress:
        path = train(
            character, groom or [], motion or [], out, settings | pairs(setting, "--set"), method=method, paper=paper,
            skeleton=skeleton, head=head, joints=pairs(joint, "--joint"), begin=begin, resume=resume, variations=variations, gestures=numbers(gesture, "--gesture"),
            rollouts=rollouts, processes=processes, credits=credit or [], keep_work=keep_work, tell=note, progress=progress,
        )  # fmt: skip
    meta = model_file.read(path).meta
    if as_json:
        print_json({"path": str(path), "training": meta["training"], "report": meta["report"]})
        return
    say(f"{path}: {meta['training']['steps']:,} steps in {meta['training']['minutes']:g} min")
    say(_reached(meta["report"], all(meta["training"].get(KEPT, []))))


def _reached(report: dict, strands_too: bool) -> str:
    """What a training's report says, for a terminal; `strands_too`: its strands are held out as well."""
    held, begun = report[HELD], report.get(HELD_BEGUN)
    unseen = "motion and strands" if strands_too else "motion"
    before = f", the model that it began with {begun['motion']:.2f}" if begun else ""
    return (
        f"on {unseen} that it never saw: motion error {held['motion']:.2f} (hair carried rigidly 1{before}), "
        f"motion {held['motion_ratio']:.0%} of the solver's, position {held['position']:.1f} % of strand length off "
        f"(rigidly {held['rigid']:.1f} %)"
    )


def _how_to_go_on(out: Path) -> list[str]:
    """How to resume: a training that starts anew deletes what an earlier one kept."""
    from neuralocks_core.training.work_folder import work_folder

    try:
        work_folder(out, resume=True)
    except NeuralocksError:  # nothing kept yet
        return []
    return ["the same command with --resume continues from here; without it, training starts over"]
