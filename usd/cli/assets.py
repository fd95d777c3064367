# SPDX-License-Identifier: Apache-2.0
"""`neuralocks import`, `neuralocks grow` and `neuralocks body`: hair and bodies to begin with."""

from pathlib import Path
from typing import Annotated

import typer

from .command import note, print_json, say
from .options import AsJson, Grooms, Head, Out, Replaced, Seed, Skeleton, WithCharacter, numbers


def import_command(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="TressFX .tfx, Cem Yuksel .hair, .data, CT2Hair .bin or USD curves: parts of one head's hair."
        ),
    ],
    out: Out,
    unit: Annotated[
        str | None,
        typer.Option(
            help="mm, cm, m, in, or metres per unit of the file; if left out, as the file says or the scalp's size suggests, and with --character sized to fit the head."
        ),
    ] = None,
    up: Annotated[
        str | None, typer.Option(help="Up axis of the file, Y or Z; if left out, the usual one of its format.")
    ] = None,
    character: Annotated[
        Path | None,
        typer.Option(help="USD character on whose head to put the hair."),
    ] = None,
    groom: Grooms = None,
    skeleton: Skeleton = None,
    head: Head = None,
    with_character: WithCharacter = False,
    replace: Replaced = None,
    as_json: AsJson = False,
) -> None:
    """Write hair files as USD grooms, as they are or on the head of a character."""
    from ..assets.importing import import_groom
    from ..review.groom_facts import groom_facts
    from .progress import progress_bar

    with progress_bar("importing") as progress:
        grooms, notes = import_groom(
            files, out, unit, up,
            character=character, grooms=groom or None, skeleton=skeleton, head=head, with_character=with_character,
            replaced=replace or None, progress=progress,
        )  # fmt: skip
    note(notes)
    if as_json:
        print_json({"path": str(out), "grooms": [groom_facts(g) for g in grooms], "notes": notes})
    else:
        for groom in grooms:
            say(f"{out}: {groom.strand_count} strands, {len(groom.points)} vertices of {groom.name}")


def grow_command(
    style: Annotated[
        str,
        typer.Argument(
            help="A style of the procedural library: long_straight, wavy, bob, fringe, pixie, tight_curls, coils, afro, mohawk, "
            "ponytail, braid or bun."
        ),
    ],
    character: Annotated[Path, typer.Option(help="USD character to grow it on.")],
    out: Out,
    count: Annotated[int, typer.Option(help="Strands, up to 150,000.")] = 10_000,
    seed: Seed = 0,
    variation: Annotated[
        int,
        typer.Option(min=0, help="Number of a variation, with another cut, parting and waves; 0 is the style itself."),
    ] = 0,
    skeleton: Skeleton = None,
    head: Head = None,
    with_character: WithCharacter = False,
    replace: Replaced = None,
) -> None:
    """Grow a hairstyle on a character and write it as a USD groom."""
    from ..assets.grow import grow
    from .progress import progress_bar

    with progress_bar("growing") as progress:
        path = grow(
            style, character, out, count, seed,
            variation=variation, skeleton=skeleton, head=head, with_character=with_character, replaced=replace or None,
            tell=note, progress=progress,
        )  # fmt: skip
    say(str(path))


def body_command(
    out: Out,
    phenotype: Annotated[list[str] | None, typer.Option(help="NAME=VALUE of anny's parameters, 0 to 1.")] = None,
) -> None:
    """Write the statistical body anny as a USD character (extra 'body')."""
    from ..assets.body import write_body

    say(str(write_body(out, phenotype=numbers(phenotype, "--phenotype") or None)))
