# SPDX-License-Identifier: Apache-2.0
"""Whether a rig bake still shows the animation that it was made from."""

import numpy as np

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.errors import NeuralocksError

from .joints import JointSource
from .rig_copy import alike, hair_of, outdated_of, source_of

COMPARED = 100
"""About this many poses of a rig bake are compared with those that it was made from."""


def copy_notes(source: JointSource, outdated: bool) -> list[str]:
    """The notes on a rig bake whose body, which is `outdated` then, or hair is of an earlier state of the animation that it was made
    from.
    """
    copy = source.copied or source.animation
    notes = []
    if outdated:
        fact = f"its animation {copy.GetName()} is a rig bake of {source_of(copy).GetPath()}, which has changed since"
        remedy = "what that shows is read" if source.copied else "bake the rig again"
        notes.append(f"{source.path}: {fact}; {remedy}")
    if source.copied is None and copy and (old := outdated_of(copy)):
        notes.append(outdated_note(source, old))
    return notes


def is_outdated(source: JointSource, time_codes: np.ndarray) -> bool:
    """Whether the body of a rig bake moves otherwise than the animation that it was made from, in some of the poses at these time
    codes.
    """
    copy = source.copied or source.animation
    if not copy or not source_of(copy):
        return False
    codes, hair = time_codes[:: max(1, len(time_codes) // COMPARED)], hair_of(copy)
    body = [joint for joint, name in enumerate(source.names) if name not in hair]
    try:
        both = [JointSource(source.prim, unbaked) for unbaked in (False, True)]
        same = alike(*(each.local(codes)[:, body] for each in both))
        return not (same and np.allclose(*(each.shape(both[1].shape_names, codes) for each in both), atol=1e-4))
    except NeuralocksError:  # reported when one is read
        return False


def outdated_note(source: JointSource, joints) -> str:
    """The note on hair joints that a rig bake keeps from an earlier one, made from an animation that has changed since."""
    first, *others = map(leaf, joints)
    keeps = f"and {len(others)} more hair joints keep" if others else "keeps"
    return (
        f"{source.path}: '{first}' {keeps} the motion of an earlier animation; bake from this file again with the model of that "
        "hair"
    )
