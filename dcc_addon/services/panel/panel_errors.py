# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors and notes of the core in the words of the panel: the core names options and remedies of the command line."""

import re

WORDS = (
    (
        "name them with --chains PATTERN, or the joint that carries them with --head JOINT",
        "name their first bones under Chains, or choose the bone that carries them as Head Bone",
    ),
    (" (neuralocks rig train)", " (Train for This Character)"),
    ("see neuralocks inspect for their names", "look at the armature for their names"),
    ("leave it out for the shipped one", "leave Model empty for the shipped one"),
    ("or give --model", "or choose another model"),
    ("name it with --head JOINT", "choose it as Head Bone"),
    ("name the joint that carries the hair with --head JOINT", "choose the bone that carries the hair as Head Bone"),
    ("name that with --head ", "choose as Head Bone "),
    ("train and bake with --head ", "choose as Head Bone "),
    ("take that head with --head ", "choose as Head Bone "),
    ("check --joint and --head", "choose another Head Bone"),
    ("give fewer with --frames FIRST:LAST:STEP", "bake fewer frames, or with fewer Samples"),
    ("with --chains", "under Chains"),
    ("--chains", "Chains"),
    ("; neuralocks inspect lists all", "; choose a bone of the rig"),
    (", or name it with --joint", ", or name one so"),
    ("name it with --joint ", "name the bone "),
    ("=JOINT", ""),
    (" (--cuts says where)", ""),
    ("go on with --resume", "try again"),
    ("leave out --loop", "turn Loop off"),
    ("check the stage's metersPerUnit", "check the scene's Unit Scale"),
    ("check the file's metersPerUnit and upAxis", "check the scene's Unit Scale"),
    ("check metersPerUnit and the character's scale", "check the scene's Unit Scale and the character's scale"),
    ("its skel binding puts its roots", "where its object stands in the rest pose, its roots are"),
    ("check its unit and primvars:skel:geomBindTransform", "check the object's place and scale, and its parent's"),
    ("no joint found for ", "no bone found for "),
    ("between time codes ", "between frames "),
    ("at time code ", "at frame "),
    ("train one with random_materials=True, as the other ways of training do", "train one here"),
    ("give --bend, --weight and --damping nearer to their defaults", "train again"),
)
"""What the command line says, and what the panel says instead; applied in this order."""
_CUTS = re.compile(r", or name them all if they are \(--cuts [^)]*\)")
_RATE = re.compile(r"train with a smaller --set rate(?: than \S+)?")
_MEANING = re.compile(r"; check --joint \S+")
"""Remedies that the panel does not have."""
_REFERENCE = re.compile(r"let the hair start anew there \(--cuts [^)]*\)")
"""One for which it has another: what is before the frame range is not sampled."""

_JOINT = re.compile(r"joint '(?:[^']*/)?([^'/]+)'")
"""A bone as it is written to a file, with all bones above it."""


def for_the_panel(text: str, prims: dict[str, str] | None = None) -> str:
    """The line of an error or a note, without options and commands of a terminal.

    Args:
        prims: prim path by object name; where the line names one of these prims, it then names the object.
    """
    text = _with_objects(text, prims) if prims else text
    for said, shown in WORDS:
        text = text.replace(said, shown)
    text = _REFERENCE.sub("begin the frame range there", _MEANING.sub("", _CUTS.sub("", text)))
    return _JOINT.sub(r"bone '\1'", _RATE.sub("train again", text))


def _with_objects(text: str, prims: dict[str, str]) -> str:
    names = {prim: name for name, prim in prims.items()}
    paths = "|".join(map(re.escape, names))
    return re.sub(rf"({paths})(?!\w)", lambda found: names[found[0]], text)
