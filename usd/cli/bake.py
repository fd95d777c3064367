# SPDX-License-Identifier: Apache-2.0
"""`neuralocks bake`, `neuralocks join` and `neuralocks simulate`."""

from pathlib import Path
from typing import Annotated

import typer

from .command import counted, note, noting_when_cut_short, print_json, say
from .options import (
    AsJson,
    Cuts,
    Frames,
    Grooms,
    Gusts,
    Head,
    Jobs,
    Joints,
    Loop,
    Materials,
    Model,
    Out,
    Skeleton,
    Subframes,
    WindVector,
    cut_codes,
    pairs,
    vector,
)


def bake_command(
    shot: Annotated[Path, typer.Argument(help="USD stage with an animated skeleton and at least one groom.")],
    out: Out,
    model: Model = None,
    groom: Grooms = None,
    skeleton: Skeleton = None,
    head: Head = None,
    joint: Joints = None,
    frames: Frames = None,
    subframes: Subframes = 1,
    material: Materials = None,
    strength: Annotated[
        float, typer.Option(help="Motion strength from 0 (each pose as if held) to 4; 1 is as trained.")
    ] = 1.0,
    wind: WindVector = None,
    gusts: Gusts = None,
    resolve: Annotated[bool, typer.Option(help="Push hair out of the body after the network.")] = True,
    loop: Loop = False,
    cuts: Cuts = None,
    velocities: Annotated[bool, typer.Option(help="Write velocities for motion blur.")] = True,
    jobs: Jobs = None,
    as_json: AsJson = False,
) -> None:
    """Bake moving hair into an override layer over the shot.

    The shot is a sublayer of it: open the layer for the whole shot with moving hair, mute it to get the shot back. To
    resume a bake that was stopped, give the same command again. On a farm, bake parts of the range with --frames;
    neuralocks join makes one bake of them.
    """
    from ..baking.bake import bake
    from .progress import progress_bar

    with noting_when_cut_short(lambda: _how_to_go_on(out)), progress_bar("baking") as progress:
        result = bake(
            shot, out, model, grooms=groom or None, skeleton=skeleton, head=head, frames=frames,
            joints=pairs(joint, "--joint"), subframes=subframes, material=material, strength=strength,
            wind=vector(wind, "--wind"), gusts=gusts, resolve=resolve, loop=loop, cuts=cut_codes(cuts), velocities=velocities,
            jobs=jobs, tell=note, progress=progress,
        )  # fmt: skip
    _bake_report(result, as_json)


def join_command(
    parts: Annotated[list[Path], typer.Argument(help="Bakes of parts of the shot (frames or grooms), in any order.")],
    out: Out,
    as_json: AsJson = False,
) -> None:
    """Join partial bakes of a shot, such as those from a farm, into one.

    The file is the same, byte for byte, as if all frames and characters had been baked at once.
    """
    from ..baking.join import join
    from .progress import progress_bar

    with progress_bar("joining") as progress:
        result = join(parts, out, progress=progress)
    note(result.notes)
    if as_json:
        print_json(vars(result) | {"path": str(result.path)})
    else:
        say(f"{result.path}: {_span(result.frames)} of {counted(len(parts), 'part')}")


def simulate_command(
    shot: Annotated[Path, typer.Argument(help="USD stage with an animated skeleton and at least one groom.")],
    out: Out,
    groom: Grooms = None,
    skeleton: Skeleton = None,
    head: Head = None,
    joint: Joints = None,
    frames: Frames = None,
    subframes: Subframes = 1,
    material: Materials = None,
    wind: WindVector = None,
    gusts: Gusts = None,
    strands: Annotated[
        int | None, typer.Option(help="Simulate at most this many strands, 2000 if left out; the others follow them.")
    ] = None,
    loop: Loop = False,
    cuts: Cuts = None,
    volume: Annotated[
        float, typer.Option(help="Stiffness that keeps strands from crowding closer than in the groom; try 0.3.")
    ] = 0.0,
    xpbd: Annotated[
        int | None,
        typer.Option(
            metavar="SUBSTEPS",
            help="Simulate by XPBD, as games do, with so many substeps per 1/30 s: usually 10, 20 or 50, at most 500. Clumping "
            "then does nothing, and --volume cannot be added.",
        ),
    ] = None,
    device: Annotated[str, typer.Option(help="Where the solver runs: cpu, or cuda for an NVIDIA GPU.")] = "cpu",
    as_json: AsJson = False,
) -> None:
    """Bake with the slow reference solver instead of the network, to compare with (extra 'compare').

    At the end it says how far from solved the steps were: the rms net force per mass that was left; with
    --xpbd it does not, because that solves no equations.
    """
    from ..baking.simulate import simulate
    from .progress import progress_bar

    with noting_when_cut_short(lambda: _how_to_go_on(out)), progress_bar("simulating") as progress:
        result = simulate(
            shot, out, grooms=groom or None, skeleton=skeleton, head=head, frames=frames,
            joints=pairs(joint, "--joint"), subframes=subframes, material=material,
            wind=vector(wind, "--wind"), gusts=gusts, strands=strands, volume=volume, xpbd=xpbd, device=device,
            loop=loop, cuts=cut_codes(cuts), tell=note, progress=progress,
        )  # fmt: skip
    _bake_report(result, as_json)


def _how_to_go_on(out: Path) -> list[str]:
    """How to resume: nobody would look for samples in a hidden folder."""
    from ..baking.layer.spool import kept

    samples = kept(out)
    return [f"the same command continues from here, with {counted(samples, 'sample')} done"] if samples else []


def _bake_report(result, as_json: bool) -> None:
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
            | ({"residual": result.residual} if result.residual else {})
        )
        return
    for groom in result.grooms:
        by = f", moved by the model {groom['model']}" if "model" in groom else ""
        say(f"{groom['path']}: {groom['strands']} strands, carried by {groom['how']}{by}")
    if left := result.residual:
        say(
            f"the solver's residual, its rms net force per mass in 9.81 m/s^2: {left['median']:.2g} in the median of "
            f"{counted(left['steps'], 'step')}, {left['worst']:.2g} in the worst"
        )
    taken = f", {result.resumed} taken over from an interrupted bake" if result.resumed else ""
    say(f"{result.path}: {_span(result.frames)} in {result.seconds:.1f} s{taken}")


def _span(codes: list[float]) -> str:
    first, last = codes[0], codes[-1]
    return f"{counted(len(codes), 'sample')} {f'at {first:g}' if first == last else f'from {first:g} to {last:g}'}"
