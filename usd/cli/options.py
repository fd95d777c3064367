# SPDX-License-Identifier: Apache-2.0
"""Options that several commands share, and the words NAME=VALUE."""

from pathlib import Path
from typing import Annotated

import typer

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.number_words import plain_number

Out = Annotated[Path, typer.Option("-o", "--out", help="File to write.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON for a machine to read.")]
Grooms = Annotated[
    list[str] | None, typer.Option("--groom", help="Prim path of a groom; repeat for more. All hair if left out.")
]
Skeleton = Annotated[
    str | None, typer.Option("--skeleton", help="The skeleton, by path or name, if there are several.")
]
Head = Annotated[
    str | None, typer.Option("--head", help="The head joint, if its name does not tell; it carries unbound hair.")
]
WithCharacter = Annotated[
    bool,
    typer.Option(
        "--with-character",
        help="Write a layer over the character's file, to be opened and baked as it is (with the same --skeleton).",
    ),
]
Replaced = Annotated[
    list[str] | None,
    typer.Option(
        "--replace", help="With --with-character: prim path of hair that the new hair replaces; repeat for more."
    ),
]
Joints = Annotated[
    list[str] | None,
    typer.Option("--joint", help="MEANING=JOINT, such as left_upper_arm=arm_L, if names do not tell; repeat for more."),
]
Frames = Annotated[
    str | None,
    typer.Option("--frames", help="FIRST:LAST[:STEP] in time codes; the shot's range if left out."),
]
Subframes = Annotated[int, typer.Option("--subframes", help="Samples per frame, at most 64, for motion blur.")]
Materials = Annotated[
    list[str] | None,
    typer.Option(
        "--material",
        help="NAME=VALUE, or NAME=2x for twice the default; repeat for more. stiffness 0.001 (0.0002..0.005) m^4/s^2, "
        "weight 1 (0.5..2) times gravity, damping 10 (4..20) /s, clumping 60 (0..240) /s^2.",
    ),
]
WindVector = Annotated[
    str | None,
    typer.Option(
        "--wind", help="X,Y,Z: how a wind accelerates all hair, in the stage's axes, at most 8 m/s^2 (try 2)."
    ),
]
Gusts = Annotated[
    float | None, typer.Option("--gusts", help="Share by which the wind varies, 0 (steady) to 1; 0.5 if left out.")
]
Loop = Annotated[bool, typer.Option("--loop", help="The clip repeats: its last sample shows the pose of its first.")]
Cuts = Annotated[
    list[str] | None,
    typer.Option(
        "--cuts",
        help="First frames after cuts, such as 25,49, or 'none'; hair starts anew there. Detected if left out.",
    ),
]
Model = Annotated[
    Path | None, typer.Option("--model", help="A .neuralocks file; if left out, the shipped one that suits the groom.")
]
Seed = Annotated[int, typer.Option("--seed", min=0, max=2**32 - 1, help="Random seed.")]
Jobs = Annotated[
    int | None, typer.Option("--jobs", help="Threads; if left out one per core, at most eight. The result is the same.")
]


def cut_codes(given: list[str] | None) -> list[float] | None:
    """Time codes of `--cuts`, given once or several times: empty for 'none', None to detect them."""
    if not given:
        return None
    text = ",".join(given)
    if text.strip().lower() == "none":
        return []
    try:
        return [plain_number(code) for code in text.split(",")]
    except ValueError:
        raise NeuralocksError(f"--cuts {text}: is not a list of frames; write for example 25,49, or none") from None


def vector(text: str | None, option: str) -> tuple[float, ...] | None:
    """Three numbers X,Y,Z, given to `option`; None if it was not given."""
    if text is None:
        return None
    try:
        x, y, z = (plain_number(part) for part in text.split(","))
    except ValueError:
        raise NeuralocksError(f"{option} {text}: is not X,Y,Z; write for example 2,0,0") from None
    return x, y, z


def pairs(words: list[str] | None, option: str) -> dict[str, str]:
    """{NAME: VALUE} of words NAME=VALUE, given to `option`."""
    found = {}
    for word in words or ():
        name, equals, value = word.partition("=")
        if not (name.strip() and equals and value.strip()):
            raise NeuralocksError(f"{option} {word}: is not NAME=VALUE; give both sides of '='")
        if name.strip() in found:
            raise NeuralocksError(f"{option} {word}: {name.strip()} is given twice; give it once")
        found[name.strip()] = value.strip()
    return found


def numbers(words: list[str] | None, option: str) -> dict[str, float]:
    """Like `pairs`, with numbers for values."""
    found = pairs(words, option)
    try:
        return {name: plain_number(text) for name, text in found.items()}
    except ValueError:
        raise NeuralocksError(f"{option} {' '.join(words or ())}: is not NAME=NUMBER; give numbers") from None


def sides(text: str) -> tuple[int, int]:
    """Width and height of `--size`, WIDTHxHEIGHT."""
    both = text.lower().split("x")
    if len(both) != 2 or not all(side.strip().isdecimal() and len(side) < 9 for side in both):
        raise NeuralocksError(f"--size {text}: is not WIDTHxHEIGHT; write for example 640x480")
    return int(both[0]), int(both[1])
