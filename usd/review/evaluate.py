# SPDX-License-Identifier: Apache-2.0
"""`neuralocks evaluate`: the report card of a bake."""

import numpy as np

from neuralocks_core import metrics
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.evaluation.report import Card
from neuralocks_core.materials import Material
from neuralocks_core.progress import Progress, silent
from neuralocks_core.runtime import StrandModel

from ..border.damage import names_damage
from ..shot.recorded import recorded_material
from .baked import Baked, read_baked
from .subject import Subject


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
    material: Material | None = None,
    progress: Progress | None = None,
) -> Card:
    """Measure a bake, whatever made it.

    Args:
        baked: path of the bake, or a `Baked` already read.
        reference: simulate the same strands and compare.
        grooms, skeleton, head, joints: as for `bake`.
        model: with `reference`, the model whose held-pose answer is shown next to it; the shipped one if left out.
        material: what the hair is made of, for energies and reference; if left out, what each groom's bake records.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: the file is not a bake, or the reference is not installed.
    """
    beside = _model_beside(model) if reference else None  # before minutes of work
    if not isinstance(baked, Baked):
        baked = read_baked(baked, grooms, skeleton, head, joints)
    say = progress or silent
    measured, compared, curves = {}, {}, {}
    notes = list(baked.shot.notes)
    each = {item.path: baked.alone(item) for item in baked.shot.grooms}
    if min(len(own.codes) for own in each.values()) < 3:
        notes.append("fewer than three frames: motion is neither measured nor compared")
    for number, item in enumerate(baked.shot.grooms, 1):
        own = each[item.path]
        subject = Subject(own, item, _numbered(say, number, len(each)))
        look = material or recorded_material(item.prim) or Material()
        measured[item.path] = subject.measures(look)
        if not len(subject.chosen):
            notes.append(f"{item.path}: no strand has two distinct points; nothing is measured")
            continue
        curves[item.path] = {"times": own.times, "bake": metrics.tip_curves(subject.moved)}
        curves[item.path]["rigid"] = np.zeros_like(curves[item.path]["bake"])
        if reference and len(own.codes) >= 3:
            rows, tips = subject.compared(look, beside)
            compared[item.path] = rows
            curves[item.path] |= tips
    return Card(str(baked.shot.path), measured, compared, curves, tuple(notes))


def _numbered(say: Progress, number: int, count: int) -> Progress:
    """Progress of one of several grooms, each of which begins anew: share and time left are of that one's step."""
    if count == 1:
        return say
    return lambda done, total, message="": say(done, total, f"groom {number} of {count}: {message}")


def _model_beside(given) -> StrandModel | None:
    """The model whose held-pose answer is shown; if none is given, the shipped one, if there is one."""
    try:
        return given if isinstance(given, StrandModel) else StrandModel.load(given)
    except NeuralocksError:
        if given is not None:
            raise
        return None
