# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors of the core in the words of the panel: it names what to do as the command line does."""

WORDS = (
    (
        "name them with --chains PATTERN, or the joint that carries them with --head JOINT",
        "name their first bones under Chains, or choose the bone that carries them as Head bone",
    ),
    (" (neuralocks rig train)", " (Train for This Character)"),
    ("see neuralocks inspect for their names", "look at the armature for their names"),
    ("leave it out for the shipped one", "leave Model empty for the shipped one"),
    ("or give --model", "or choose another model"),
    ("name it with --head JOINT", "choose it as Head bone"),
    ("name the joint that carries the hair with --head JOINT", "choose the bone that carries the hair as Head bone"),
    ("name that with --head ", "choose as Head bone "),
    ("with --chains", "under Chains"),
    ("--chains", "Chains"),
    ("; neuralocks inspect lists all", "; choose a bone of the rig"),
)
"""What the command line says, and the panel; in this order."""


def for_the_panel(text: str) -> str:
    """An error's line, without options and commands of a terminal."""
    for said, shown in WORDS:
        text = text.replace(said, shown)
    return text
