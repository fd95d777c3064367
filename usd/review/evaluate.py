# SPDX-License-Identifier: Apache-2.0
"""`neuralocks evaluate`: the report card of a bake."""

import numpy as np

from neuralocks_core import metrics
from neuralocks_core.arguments import flag
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.evaluation.report import Card
from neuralocks_core.materials import Material
from neuralocks_core.progress import Progress, silent

from ..baking.bake import as_material
from ..baking.batches import grouped
from ..baking.groom_models import GroomModels
from ..border.damage import names_damage
from ..shot.bakes.bake_record import recorded_material
from ..shot.stage import StageGroom
from .baked import Baked, read_baked
from .depths import depths
from .subject import STRANDS, Subject


@names_damage
def evaluate(
    baked,
    reference: bool = False,
    *,
    grooms=None,
    skeleton: str | None = None,
    head: str | None = None,
    joints: dict[str, str] | None = None,
    model=None,
    material=None,
    progress: Progress | None = None,
) -> Card:
    """Measure a bake, whatever made it.

    Args:
        baked: path of the bake, or a `Baked` already read.
        reference: simulate the same strands and compare.
        grooms, skeleton, head, joints: as for `bake`.
        model: only with `reference`: the model whose held-pose answer is shown next to it; if left out, the shipped one that suits
            each groom.
        material: what the hair is made of, for energies and reference: a Material, words NAME=VALUE or a dict of them, as for
            `bake`; if left out, what each groom's bake records.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: the file is not a bake, an argument cannot be used, or the reference is not installed.
    """
    reference = flag("--reference", reference)
    if model is not None and not reference:
        raise NeuralocksError("--model: its held-pose answer is shown beside the reference; add --reference")
    asked = None if material is None else as_material(material)
    beside = _models_beside(model) if reference else None  # before minutes of work
    if not isinstance(baked, Baked):
        baked = read_baked(baked, grooms, skeleton, head, joints)
    say = progress or silent
    measured, compared, curves = {}, {}, {}
    notes = list(baked.shot.notes)
    groups, count, begin = _together(baked), len(baked.shot.grooms), 0
    if min(len(own.codes) for own, _ in groups) < 3:
        notes.append("fewer than three frames: motion is neither measured nor compared")
    for own, items in groups:
        subjects = [
            Subject(own, item, _numbered(say, number, number, count)) for number, item in enumerate(items, begin + 1)
        ]
        deep = depths(subjects, _numbered(say, begin + 1, begin + len(items), count))
        begin += len(items)
        for subject, inside in zip(subjects, deep, strict=True):
            item = subject.item
            look = asked or recorded_material(item.prim) or Material()
            measured[item.path] = subject.measures(look, inside)
            if not len(subject.chosen):
                notes.append(f"{item.path}: no strand has two distinct points; nothing is measured")
                continue
            curves[item.path] = {"times": own.times, "bake": metrics.tip_curves(subject.moved)}
            curves[item.path]["rigid"] = np.zeros_like(curves[item.path]["bake"])
            if reference and len(own.codes) >= 3:
                rows, tips = subject.compared(look, beside and beside.of(item))
                compared[item.path] = rows
                notes += subject.crowded()
                curves[item.path] |= tips
    rows = (_in_stage_order(baked, each) for each in (measured, compared, curves))
    return Card(str(baked.shot.path), *rows, tuple(notes))


def _in_stage_order(baked: Baked, rows: dict) -> dict:
    return {item.path: rows[item.path] for item in baked.shot.grooms if item.path in rows}


def _together(baked: Baked) -> list[tuple[Baked, list[StageGroom]]]:
    """Those of one head, sampled at the same time codes, together as long as no more strands of them are measured than of a large
    one.
    """
    alone = {item.path: baked.alone(item) for item in baked.shot.grooms}
    groups = grouped(
        baked.shot.grooms,
        lambda item: (id(item.attachment.character), alone[item.path].codes.tobytes()),
        lambda item: min(item.groom.strand_count, STRANDS),
        most=STRANDS,
    )
    return [(alone[items[0].path], items) for items in groups]


def _numbered(say: Progress, first: int, last: int, count: int) -> Progress:
    """Progress of one or more of several grooms, each of which begins anew: share and time left are of that one's step."""
    if count == 1:
        return say
    which = f"groom {first}" if first == last else f"grooms {first} to {last}"
    return lambda done, total, message="": say(done, total, f"{which} of {count}: {message}")


def _models_beside(given) -> GroomModels | None:
    """The models whose held-pose answers are shown; if none is given, the shipped ones, if there are any."""
    try:
        return GroomModels(given)
    except NeuralocksError:
        if given is not None:
            raise
        return None
